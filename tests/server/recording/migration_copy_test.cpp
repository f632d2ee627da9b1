// Before a database of an older schema is changed it is copied: whole, once, and never over another copy.
#include "server/storage/database/migration_copy.hpp"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <set>

#include "server/station/state/audit_note.hpp"
#include "server/storage/database/schema.hpp"
#include "server/storage/upkeep/restore.hpp"
#include "tests/server/recording/recording_test.hpp"
#include "tests/server/recording/schema_dump.hpp"

namespace server {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

class MigrationCopyTest : public RecordingTest {
 protected:
  void SetUp() override { make_database(path_, "version_6.sql"); }

  fs::path copy() const { return folder_ / "station.sqlite.schema-6"; }
  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator{folder_}) names.insert(entry.path().filename().string());
    return names;
  }
  // Everything that the file holds, but for the order of its pages.
  static std::string dump_of(const fs::path& path) {
    SQLite::Database database{path.string(), SQLite::OPEN_READONLY};
    std::string all = database.execAndGet("PRAGMA user_version").getString();
    SQLite::Statement tables{database, "SELECT name, coalesce(sql, '') FROM sqlite_master ORDER BY type, name"};
    while (tables.executeStep()) all += "\n" + tables.getColumn(1).getString();
    for (const char* query :
         {"SELECT quote(position_m) || quote(duty) FROM sample", "SELECT quote(hash) FROM audit",
          "SELECT kind || cause FROM event", "SELECT sha256 FROM run_certificate", "SELECT name || value FROM meta"}) {
      SQLite::Statement rows{database, query};
      while (rows.executeStep()) all += "\n" + rows.getColumn(0).getString();
    }
    return all;
  }
};

TEST_F(MigrationCopyTest, TheDatabaseAsItWasIsKeptBesideIt) {
  const std::string before = dump_of(path_);
  {
    const storage::Database database{path_};
  }
  EXPECT_THAT(files(), ElementsAre("station.sqlite", "station.sqlite.schema-6"));
  EXPECT_EQ(dump_of(copy()), before);
  EXPECT_EQ(fs::status(copy()).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_NE(dump_of(path_), before);
  {
    const storage::Database again{path_};
  }
  EXPECT_THAT(files(), ElementsAre("station.sqlite", "station.sqlite.schema-6"));
}

TEST_F(MigrationCopyTest, WhatTheLogHoldsIsInTheCopy) {
  SQLite::Database reader{path_.string(), SQLite::OPEN_READWRITE};
  reader.exec("PRAGMA journal_mode = WAL; PRAGMA wal_autocheckpoint = 0;");
  reader.exec("UPDATE run SET name = 'in the log' WHERE run_id = 1");
  SQLite::Statement holds_the_log{reader, "SELECT * FROM run"};
  ASSERT_TRUE(holds_the_log.executeStep());
  {
    const storage::Database database{path_};
  }
  SQLite::Database kept{copy().string(), SQLite::OPEN_READONLY};
  EXPECT_EQ(kept.execAndGet("SELECT name FROM run WHERE run_id = 1").getString(), "in the log");
  EXPECT_EQ(kept.execAndGet("PRAGMA journal_mode").getString(), "delete");
}

TEST_F(MigrationCopyTest, ANewDatabaseAndARestoredOneHaveNoCopy) {
  const fs::path fresh = folder_ / "fresh", restored = folder_ / "restored";
  fs::create_directory(fresh);
  fs::create_directory(restored);
  {
    const storage::Database database{fresh / "station.sqlite"};
  }
  EXPECT_EQ(std::distance(fs::directory_iterator{fresh}, {}), 1);
  storage::restore_database(path_, restored, station::Author{"cli:test", "", 1});
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator{restored}) names.insert(entry.path().filename().string());
  EXPECT_EQ(names, (std::set<std::string>{"station.head.json", "station.sqlite"}));
  EXPECT_EQ(dump_of(path_).substr(0, 1), "6");
}

// A power cut or a kill between the copy and the end of the migration: the next start has both, and makes no second.
TEST_F(MigrationCopyTest, AStartThatWasCutOffLeavesAUsableDatabaseAndOneCopy) {
  const std::string before = dump_of(path_);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE};
    database.exec("PRAGMA journal_mode = WAL");
    storage::keep_copy_before_migration(database, path_, 6);
    database.exec("BEGIN IMMEDIATE");
    database.exec(storage::migrations()[6]);
    ::_exit(0);  // no destructor runs
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
  EXPECT_EQ(dump_of(path_), before);
  std::ofstream{folder_ / "station.sqlite.schema-6.2.part"} << "of a start that was cut off while it copied";
  {
    const storage::Database database{path_};
  }
  EXPECT_EQ(number("PRAGMA user_version"), static_cast<std::int64_t>(storage::migrations().size()));
  EXPECT_EQ(dump_of(copy()), before);
  EXPECT_FALSE(fs::exists(folder_ / "station.sqlite.schema-6.2"));
}

TEST_F(MigrationCopyTest, ACopyThatWasCutOffMakesRoomBeforeTheRoomIsLookedAt) {
  std::ofstream{folder_ / "station.sqlite.schema-6.part"} << "of a start that was cut off while it copied";
  SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE};
  const auto full_with_it = [](const fs::path& folder) -> std::uint64_t {
    return fs::exists(folder / "station.sqlite.schema-6.part") ? 0 : 1'000'000'000'000;
  };
  storage::keep_copy_before_migration(database, path_, 6, full_with_it);
  EXPECT_THAT(files(), ElementsAre("station.sqlite", "station.sqlite.schema-6"));
}

TEST_F(MigrationCopyTest, ACopyThatIsThereStaysAndTheNextHasANumber) {
  {
    const storage::Database database{path_};
  }
  const std::string first = content_of(copy());
  fs::remove(path_);
  make_database(path_, "version_6.sql");  // somebody went back to it, and recorded
  {
    SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE};
    database.exec("UPDATE meta SET value = value + 1 WHERE name = 'next_row'");
  }
  const std::string second = dump_of(path_);
  std::ofstream{folder_ / "station.sqlite.schema-6.2"} << "not a database";
  {
    const storage::Database database{path_};
  }
  EXPECT_EQ(content_of(copy()), first);
  EXPECT_EQ(content_of(folder_ / "station.sqlite.schema-6.2"), "not a database");
  EXPECT_EQ(dump_of(folder_ / "station.sqlite.schema-6.3"), second);
}

}  // namespace
}  // namespace server
