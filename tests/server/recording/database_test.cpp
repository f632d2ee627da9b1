// What is not ours is refused and left alone; the views are answered by index and row number.
#include "server/storage/database/database.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <fstream>
#include <sstream>

#include "server/config/data_folder.hpp"
#include "server/storage/database/schema.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;

class DatabaseTest : public RecordingTest {
 protected:
  std::string refusal() {
    try {
      const storage::Database database{path_};
      return "(it was opened)";
    } catch (const std::runtime_error& error) {
      return error.what();
    }
  }
  std::string content() {
    std::ostringstream bytes;
    bytes << std::ifstream{path_, std::ios::binary}.rdbuf();
    return bytes.str();
  }
  void make(const char* sql) {
    SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE};
    database.exec(sql);
  }
};

TEST_F(DatabaseTest, ItsFilesAreForTheStationsUserOnlyAlsoInAnOpenFolder) {
  namespace fs = std::filesystem;
  const mode_t before = umask(022);
  fs::permissions(folder_, fs::perms{0755});
  {
    const config::DataFolder data{folder_};
    start();
    TestRobot robot;
    connect(robot);
    flush();
    for (const char* name : {"station.sqlite", "station.sqlite-wal", "station.sqlite-shm"}) {
      EXPECT_EQ(fs::status(folder_ / name).permissions(), fs::perms::owner_read | fs::perms::owner_write) << name;
    }
    stop();
  }
  umask(before);
}

TEST_F(DatabaseTest, ANewFileHasOurMarksAndAStoreId) {
  std::uint64_t store_id = 0;
  {
    const storage::Database database{path_};
    store_id = database.store_id();
  }
  EXPECT_NE(store_id, 0u);
  EXPECT_EQ(storage::Database{path_}.store_id(), store_id);
  EXPECT_EQ(number("PRAGMA application_id"), storage::kApplicationId);
  EXPECT_EQ(number("PRAGMA user_version"), static_cast<std::int64_t>(storage::migrations().size()));
  EXPECT_EQ(number("PRAGMA page_size"), 4096);
  EXPECT_EQ(number("PRAGMA auto_vacuum"), 2);
  EXPECT_EQ(rows("PRAGMA journal_mode"), std::vector<std::string>{"wal"});
  EXPECT_EQ(std::filesystem::status(path_).permissions() & std::filesystem::perms::others_read,
            std::filesystem::perms::none);
}

TEST_F(DatabaseTest, RefusesWhatIsNotADatabaseAndLeavesIt) {
  std::ofstream{path_} << std::string(5000, 'x');
  const std::string before = content();
  EXPECT_THAT(refusal(), HasSubstr("it is not an SQLite database"));
  EXPECT_THAT(refusal(), HasSubstr(path_.string()));
  EXPECT_EQ(content(), before);
}

TEST_F(DatabaseTest, IsNotWrittenThroughALink) {
  const std::filesystem::path elsewhere = folder_ / "elsewhere.sqlite";
  std::filesystem::create_symlink(elsewhere, path_);
  EXPECT_THAT(refusal(), HasSubstr("is a link"));
  EXPECT_THAT(refusal(), HasSubstr("--data"));
  EXPECT_FALSE(exists(elsewhere));
}

TEST_F(DatabaseTest, RefusesTheDatabaseOfAnotherProgramAndLeavesIt) {
  make("PRAGMA application_id = 4711; CREATE TABLE theirs (x); INSERT INTO theirs VALUES (1);");
  const std::string before = content();
  EXPECT_THAT(refusal(), HasSubstr("belongs to another program (application_id 0x1267"));
  EXPECT_EQ(content(), before);
}

TEST_F(DatabaseTest, RefusesAnUnmarkedDatabaseWithTables) {
  make("CREATE TABLE theirs (x)");
  EXPECT_THAT(refusal(), HasSubstr("belongs to another program"));
}

TEST_F(DatabaseTest, RefusesANewerSchema) {
  {
    const storage::Database database{path_};
  }
  make("PRAGMA user_version = 99");
  const std::string before = content();
  EXPECT_THAT(refusal(), HasSubstr("its schema is version 99"));
  EXPECT_EQ(content(), before);
}

TEST_F(DatabaseTest, RefusesADatabaseWithACorruptHeader) {
  {
    const storage::Database database{path_};
  }
  {
    std::fstream file{path_, std::ios::binary | std::ios::in | std::ios::out};
    file.seekp(100);
    file << std::string(300, '\xff');  // the page of the schema
  }
  EXPECT_THAT(refusal(), HasSubstr("cannot record into"));
}

TEST_F(DatabaseTest, TakesAnEmptyFile) {
  std::ofstream{path_}.flush();
  EXPECT_NE(storage::Database{path_}.store_id(), 0u);
}

TEST_F(DatabaseTest, AStationWithAForeignFileDoesNotStart) {
  std::ofstream{path_} << std::string(5000, 'x');
  EXPECT_THROW(start(), std::runtime_error);
}

TEST_F(DatabaseTest, TheSegmentChecksHold) {
  storage::Database database{path_};
  database.handle().exec("PRAGMA foreign_keys = OFF");
  const auto insert = [&](int last_seq, int last_row) {
    database.handle().exec(fmt::format(
        "INSERT INTO segment (boot_key, first_seq, last_seq, first_row, last_row, first_robot_time_us, period_us,"
        " received_at_us, utc_offset_us, clock_uncertainty_us, mode, sub_state, disturbance_m, position_sd_m,"
        " controller_id, emergency_id, emergency_cause, flags)"
        " VALUES (1, 0, {}, 0, {}, 0, 1, 0, 0, 0, '', '', 0, 0, 0, 0, '', 0)",
        last_seq, last_row));
  };
  EXPECT_THROW(insert(9, 8), SQLite::Exception);
  EXPECT_THROW(insert(100, 100), SQLite::Exception);
  EXPECT_NO_THROW(insert(99, 99));
  EXPECT_THROW(insert(5, 5), SQLite::Exception);  // the same first_seq twice
}

TEST_F(DatabaseTest, RunSampleIsAnsweredByIndexAndRowNumber) {
  {
    const storage::Database database{path_};
  }
  std::vector<std::string> plan;
  for (const std::string& row : rows("EXPLAIN QUERY PLAN SELECT * FROM run_sample WHERE run_id = 1")) {
    plan.push_back(row.substr(row.rfind('|') + 1));
  }
  EXPECT_EQ(plan, (std::vector<std::string>{
                      "SEARCH run_span USING PRIMARY KEY (run_id=?)", "SEARCH boot USING INTEGER PRIMARY KEY (rowid=?)",
                      "SEARCH segment USING INDEX segment_by_seq (boot_key=? AND first_seq>? AND first_seq<?)",
                      "SEARCH sample USING INTEGER PRIMARY KEY (rowid>? AND rowid<?)"}));
}

}  // namespace
}  // namespace server
