// A write-ahead log that is removed or cut, a database that began anew and an older copy in its place are noticed, and
// what they cost is seconds.
#include "server/storage/upkeep/store_head.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <fstream>

#include "server/storage/database/schema.hpp"
#include "server/storage/upkeep/restore.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

namespace fs = std::filesystem;
using Rows = std::vector<std::string>;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class StoreHeadTest : public RecordingTest {
 protected:
  fs::path log() const { return path_.string() + "-wal"; }

  // kill() closes the database, which empties its log; this leaves the files as they are, in another folder.
  void kill_at_once() {
    const fs::path left = folder_ / fmt::format("left{}", ++kills_);
    fs::create_directories(left);
    for (const char* name : {"station.sqlite", "station.sqlite-wal", "station.head.json"}) {
      fs::copy_file(path_.parent_path() / name, left / name);
    }
    kill();
    path_ = left / "station.sqlite";
  }

  void lose_log() {
    ASSERT_GT(fs::file_size(log()), 0U);
    fs::remove(log());
  }

  std::vector<std::string> losses() const {
    std::vector<std::string> problems;
    for (const storage::StoreLoss& loss : recording_->head_watch.losses()) problems.push_back(loss.problem);
    return problems;
  }

  storage::HeadFile head_file() {
    const auto file = storage::load_head_file(path_);
    if (!file) throw std::runtime_error{file.error().detail};
    return file->value_or(storage::HeadFile{});
  }

  storage::StoreHead head_of_database() {
    SQLite::Database database = storage::open_for_reading(path_);
    return storage::read_store_head(database);
  }

  // The file alone, as it is without its log.
  std::int64_t number_without_log(const std::string& sql) {
    const fs::path copy = folder_ / "without_log.sqlite";
    fs::copy_file(path_, copy, fs::copy_options::overwrite_existing);
    SQLite::Database database{copy.string(), SQLite::OPEN_READWRITE};
    return database.execAndGet(sql).getInt64();
  }

  void record(std::size_t samples) {
    start();
    connect(robot_);
    make_slowly(robot_, samples);
    robot_.oldest_seq = robot_.acknowledged_next_seq = durable_next_seq_;
  }

  TestRobot robot_;
  int kills_ = 0;
};

TEST_F(StoreHeadTest, AHeadThatIsALinkIsNotReadAndReplaced) {
  start();
  stop();
  const fs::path head = storage::head_file_of(path_), elsewhere = folder_ / "elsewhere.json";
  fs::rename(head, elsewhere);
  fs::create_symlink(elsewhere, head);
  const auto size = fs::file_size(elsewhere);
  const auto loaded = storage::load_head_file(path_);
  ASSERT_FALSE(loaded);
  EXPECT_THAT(loaded.error().detail, HasSubstr("is a link"));
  storage::save_head_file(path_, {});
  EXPECT_FALSE(is_symlink(head));
  EXPECT_EQ(fs::file_size(elsewhere), size);
}

TEST_F(StoreHeadTest, TheSchemaAndTheStoresIdentityAreInTheFileFromTheStart) {
  const storage::Database database{path_};
  EXPECT_EQ(number_without_log("PRAGMA user_version"), static_cast<std::int64_t>(storage::migrations().size()));
  EXPECT_EQ(static_cast<std::uint64_t>(number_without_log("SELECT value FROM meta WHERE name = 'store_id'")),
            database.store_id());
}

TEST_F(StoreHeadTest, TheFirstSamplesAreInTheFileWithTheirCommit) {
  start();
  connect(robot_);
  ASSERT_TRUE(clock_.run_until(
      [&] {
        make_slowly(robot_, 5);
        return recorder_->counters().samples_written > 0;
      },
      5s));
  clock_.settle();
  EXPECT_GT(number_without_log("SELECT count(*) FROM sample"), 0);
}

TEST_F(StoreHeadTest, WhatIsOlderThanSecondsIsInTheFile) {
  record(4000);
  EXPECT_GE(number_without_log("SELECT count(*) FROM sample"), 4000 - 1000 - 300);
  clock_.run_for(11s);  // nothing comes any more
  EXPECT_EQ(number_without_log("SELECT count(*) FROM sample"), 4000);
  EXPECT_LE(recorder_->wal().checkpoints, 10U);
}

TEST_F(StoreHeadTest, WhatAReaderKeptInTheLogIsInTheFileSoonAfterItHasGone) {
  record(1000);
  clock_.run_for(11s);
  const std::uint64_t passes = recorder_->wal().checkpoints;
  {
    SQLite::Database reader = storage::open_for_reading(path_);
    const SQLite::Transaction reads{reader};
    reader.execAndGet("SELECT count(*) FROM sample");
    make_slowly(robot_, 100);
    clock_.run_for(10s);
    EXPECT_GT(recorder_->wal().checkpoints, passes);
    EXPECT_LT(number_without_log("SELECT count(*) FROM sample"), 1100);
    EXPECT_LE(recorder_->wal().checkpoints, passes + 10) << "it is tried less and less often";
    make_slowly(robot_, 5);
  }
  disconnect(robot_);
  clock_.run_for(7s);  // the longest wait between two tries that began 10 s ago
  EXPECT_EQ(number_without_log("SELECT count(*) FROM sample"), 1105);
}

TEST_F(StoreHeadTest, AStopAKillAndAStartAreNoLoss) {
  for (int life = 0; life < 3; ++life) {
    record(500);
    EXPECT_THAT(losses(), IsEmpty());
    life == 1 ? stop() : kill_at_once();
  }
  start();
  EXPECT_THAT(losses(), IsEmpty());
  stop();
  EXPECT_EQ(head_file().head, head_of_database());
  EXPECT_GT(head_file().head.commits, 0);
  EXPECT_GT(head_file().head.audit.entry, 0);
}

TEST_F(StoreHeadTest, ALogThatIsGoneIsReportedUntilAnAdminAcknowledgesIt) {
  record(500);
  const std::uint64_t store_id = restored_.store_id;
  kill_at_once();
  lose_log();
  start();
  EXPECT_EQ(restored_.store_id, store_id) << "it is in the file";
  ASSERT_EQ(losses().size(), 1U);
  EXPECT_THAT(losses()[0], HasSubstr("the database has lost commits"));
  connect(robot_);  // and recording goes on
  send(robot_, robot_.oldest_seq, robot_.next_seq - robot_.oldest_seq);
  make_slowly(robot_, 500);
  flush();
  EXPECT_EQ(durable_next_seq_, robot_.next_seq);
  EXPECT_EQ(number("SELECT count(*) FROM audit WHERE action = 'store.loss_noticed' AND actor = 'station'"), 1);
  for (const bool orderly : {true, false}) {
    orderly ? stop() : kill_at_once();
    start();
    EXPECT_EQ(losses().size(), 1U);
  }
  EXPECT_TRUE(wait(recording_->head_watch.acknowledge({"user:anna", "10.0.0.7", clock_.utc_us()})));
  EXPECT_THAT(losses(), IsEmpty());
  EXPECT_TRUE(wait(recorder_->flush_records()));
  EXPECT_EQ(rows("SELECT actor, peer FROM audit WHERE action = 'store.loss_acknowledged'"), Rows{"user:anna|10.0.0.7"});
  kill();
  start();
  EXPECT_THAT(losses(), IsEmpty());
}

// Whatever is left of the log: either nothing that the head names is gone, or it is said.
TEST_F(StoreHeadTest, ALogThatIsCutAnywhereIsNoticed) {
  record(500);
  kill_at_once();
  const storage::HeadFile before = head_file();
  const fs::path all = path_.parent_path();
  const std::uintmax_t bytes = fs::file_size(log());
  int noticed = 0;
  constexpr std::uintmax_t kPlaces = 12;
  for (std::uintmax_t place = 0; place <= kPlaces; ++place) {
    path_ = folder_ / ("cut" + std::to_string(place)) / "station.sqlite";
    fs::copy(all, path_.parent_path());
    fs::resize_file(log(), bytes * place / kPlaces);
    const storage::StoreHead found = [this] {
      storage::Database database{path_};
      return storage::read_store_head(database.handle());
    }();
    const bool has_lost = found.commits < before.head.commits || found.audit.entry < before.head.audit.entry;
    start();
    EXPECT_EQ(losses().size(), has_lost ? 1U : 0U) << "at " << place << " of " << kPlaces;
    EXPECT_EQ(rows("PRAGMA integrity_check"), Rows{"ok"});
    noticed += has_lost ? 1 : 0;
    kill();
  }
  EXPECT_GE(noticed, 3);
  EXPECT_LT(noticed, static_cast<int>(kPlaces));
}

TEST_F(StoreHeadTest, AStoreThatBeganAnewIsNoticed) {
  record(500);
  const std::uint64_t store_id = restored_.store_id;
  stop();
  fs::remove(path_);
  start();
  EXPECT_NE(restored_.store_id, store_id);
  ASSERT_EQ(losses().size(), 1U);
  EXPECT_THAT(losses()[0], HasSubstr("store " + std::to_string(store_id)));
  EXPECT_THAT(losses()[0], HasSubstr("another one"));
}

// SQLite would delete it, and it is needed when the database is found again.
TEST_F(StoreHeadTest, TheLogOfADatabaseThatIsGoneIsKept) {
  record(500);
  kill_at_once();
  const std::uintmax_t bytes = fs::file_size(log());
  const fs::path again = folder_ / "the same log again";
  fs::copy_file(log(), again);
  for (const char* kept : {"station.sqlite-wal.orphaned", "station.sqlite-wal.orphaned-2"}) {
    fs::remove(path_);
    fs::copy_file(again, log(), fs::copy_options::overwrite_existing);
    start();
    EXPECT_FALSE(losses().empty());
    EXPECT_EQ(fs::file_size(path_.parent_path() / kept), bytes);
    stop();
  }
}

TEST_F(StoreHeadTest, AnOlderCopyInItsPlaceIsNoticed) {
  record(500);
  stop();
  fs::copy_file(path_, folder_ / "older.sqlite");
  record(500);
  stop();
  fs::copy_file(folder_ / "older.sqlite", path_, fs::copy_options::overwrite_existing);
  start();
  ASSERT_EQ(losses().size(), 1U);
  EXPECT_THAT(losses()[0], HasSubstr("an older copy"));
}

// It has as many commits and entries as its head names, but they are others.
TEST_F(StoreHeadTest, AnotherHistoryOfTheSameStoreIsNoticed) {
  record(500);
  stop();
  storage::HeadFile file = head_file();
  file.head.audit.hash[5] ^= 1;
  save_head_file(path_, file);
  start();
  EXPECT_EQ(losses().size(), 1U);
}

TEST_F(StoreHeadTest, AFileThatIsNoHeadIsReplacedAndThatNobodyKnowsWhatIsLostIsSaid) {
  record(500);
  stop();
  const std::vector<std::string> contents{"", "{", "[1]", R"({"store_id":7})", "\xff\xfe", std::string(100'000, ' ')};
  for (const std::string& content : contents) {
    std::ofstream{storage::head_file_of(path_), std::ios::trunc} << content;
    EXPECT_FALSE(storage::load_head_file(path_));
    start();
    ASSERT_EQ(losses().size(), 1U);
    EXPECT_THAT(losses()[0], HasSubstr("whether station.sqlite has lost commits cannot be told"));
    EXPECT_EQ(head_file().head.store_id, restored_.store_id);
    stop();
    EXPECT_EQ(head_file().losses.size(), 1U) << "and stays until it is acknowledged";
  }
}

TEST_F(StoreHeadTest, AHeadThatCannotBeWrittenHindersNothing) {
  record(500);
  stop();
  fs::remove(storage::head_file_of(path_));
  fs::create_directories(storage::head_file_of(path_) / "in the way");
  record(500);
  flush();
  EXPECT_EQ(durable_next_seq_, robot_.next_seq);
  EXPECT_FALSE(storage::load_head_file(path_));
  stop();
  fs::remove_all(storage::head_file_of(path_));
  start();
  EXPECT_THAT(losses(), IsEmpty());
}

TEST_F(StoreHeadTest, LossesAreBounded) {
  record(500);
  stop();
  for (int time = 0; time < 10; ++time) {
    storage::HeadFile file = head_file();
    file.head.commits += 1000;
    save_head_file(path_, file);
    start();
    stop();
  }
  start();
  EXPECT_EQ(losses().size(), storage::kMaxLosses);
}

// The file of a database that was moved away is there still.
TEST_F(StoreHeadTest, ARestoreWritesANewOne) {
  record(500);
  EXPECT_TRUE(wait(recording_->backups.begin("b")));
  EXPECT_TRUE(clock_.run_until([&] { return !recording_->backups.busy(); }, 60s));
  make_slowly(robot_, 500);
  stop();
  fs::rename(path_, folder_ / "moved_away.sqlite");
  storage::restore_database(folder_ / "backups" / "b.sqlite", folder_, {"cli:root", "", clock_.utc_us()});
  EXPECT_EQ(head_file().head, head_of_database());
  start();
  EXPECT_THAT(losses(), IsEmpty());
}

// Each robot says how far any station has acknowledged its boot.
TEST_F(StoreHeadTest, WhatWasAcknowledgedAndIsLostHasACauseOfItsOwn) {
  record(500);
  const std::uint64_t acknowledged = durable_next_seq_;
  ASSERT_GT(acknowledged, 300U);
  kill_at_once();
  lose_log();
  start();
  const std::uint64_t kept = admit(robot_).durable_next_seq;
  ASSERT_LT(kept, acknowledged);
  robot_.next_seq = acknowledged + 900;
  robot_.oldest_seq = acknowledged + 100;  // its ring ran over, too
  connect(robot_);
  send(robot_, robot_.oldest_seq, 800);
  flush();
  EXPECT_EQ(rows("SELECT first_seq, last_seq, cause FROM gap"),
            (Rows{fmt::format("{}|{}|acknowledged_earlier", kept, acknowledged - 1),
                  fmt::format("{}|{}|ring_overrun", acknowledged, acknowledged + 99)}));
  EXPECT_EQ(durable_next_seq_, robot_.next_seq);
}

}  // namespace
}  // namespace server
