// A backup becomes a station's database again: verified, marked as another store, with no run left open.
#include "server/storage/upkeep/restore.hpp"

#include <gmock/gmock.h>

#include <fstream>

#include "server/storage/database/schema.hpp"
#include "tests/server/recording/recording_test.hpp"
#include "tests/server/recording/stored_runs.hpp"

namespace server {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class RestoreTest : public RecordingTest {
 protected:
  RestoreTest() { fs::create_directories(new_folder_); }

  // 1000 samples, a run that ended and one that is open; the backup is `from_`.
  void record_and_back_up() {
    start();
    connect(robot_);
    const storage::RunId run = wait(runs_->create(robot_.id, named("ended")))->id;
    make(robot_, 400);
    EXPECT_TRUE(wait(runs_->end(run, "good")));
    EXPECT_TRUE(wait(runs_->create(robot_.id, named("open"))));
    station::RobotState in_water = state_of(robot_, station::LinkState::connected);
    in_water.fluid = "water";
    recorder_->on_fluid(in_water);
    make(robot_, 600);
    flush();
    EXPECT_TRUE(wait(recording_->backups.begin("b")));
    EXPECT_TRUE(clock_.run_until([&] { return !recording_->backups.busy(); }, 60s));
    store_id_ = restored_.store_id;
    stop();
  }

  std::string refusal(const fs::path& from) {
    try {
      storage::restore_database(from, new_folder_, {"cli:root", "", clock_.utc_us()});
      return "(it was restored)";
    } catch (const std::runtime_error& error) {
      return error.what();
    }
  }

  void use_restored() { path_ = new_folder_ / "station.sqlite"; }

  TestRobot robot_;
  std::uint64_t store_id_ = 0;
  const fs::path from_ = folder_ / "backups" / "b.sqlite";
  const fs::path new_folder_ = folder_ / "new";
};

TEST_F(RestoreTest, GivesTheSameRecordingUnderANewStoreId) {
  record_and_back_up();
  const storage::RestoredStore restored = storage::restore_database(from_, new_folder_, {"cli:root", "", 1234});
  EXPECT_EQ(restored.runs, 2);
  EXPECT_EQ(restored.samples, 1000);
  EXPECT_NE(restored.store_id, store_id_);
  use_restored();
  EXPECT_TRUE(fs::exists(new_folder_ / "station.head.json"));
  EXPECT_EQ(std::distance(fs::directory_iterator{new_folder_}, {}), 2) << "nothing else beside the database";
  EXPECT_EQ(rows("PRAGMA integrity_check"), std::vector<std::string>{"ok"});
  EXPECT_EQ(number("SELECT value FROM meta WHERE name = 'restored_at_us'"), 1234);
  EXPECT_EQ(rows("SELECT seq, position_m FROM run_sample WHERE run_id = 1 AND seq IN (0, 399)"),
            (std::vector<std::string>{"0|0.0", "399|0.398999989032745"}));
  EXPECT_EQ(fs::status(path_).permissions() & fs::perms::all, fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(RestoreTest, RunsThatWereOpenAreInterruptedAtTheirLastSample) {
  record_and_back_up();
  EXPECT_EQ(storage::restore_database(from_, new_folder_, {"cli:root", "", 1234}).runs_interrupted, 1);
  use_restored();
  EXPECT_EQ(rows("SELECT run_id, state, ended_at_us IS NULL, last_seq FROM run JOIN run_span USING (run_id)"),
            (std::vector<std::string>{"1|ended|0|399", "2|interrupted|0|999"}));
  EXPECT_EQ(number("SELECT ended_at_us FROM run WHERE run_id = 2"), number("SELECT max(received_at_us) FROM segment"));
  EXPECT_EQ(number("SELECT count(*) FROM run_sample WHERE run_id = 2"), 600);
}

TEST_F(RestoreTest, NoRobotIsTakenForBeingInTheFluidThatItWasInThen) {
  record_and_back_up();
  EXPECT_EQ(rows("SELECT fluid FROM robot"), std::vector<std::string>{"water"});
  storage::restore_database(from_, new_folder_, {"cli:root", "", 1234});
  use_restored();
  EXPECT_EQ(rows("SELECT fluid FROM robot"), std::vector<std::string>{""});
}

TEST_F(RestoreTest, ARobotGoesOnWithTheRestoredStation) {
  record_and_back_up();
  storage::restore_database(from_, new_folder_, {"cli:root", "", 1234});
  use_restored();
  start();
  EXPECT_NE(restored_.store_id, store_id_);
  EXPECT_EQ(admit(robot_).durable_next_seq, 1000U);
  connect(robot_);
  make(robot_, 100);
  flush();
  EXPECT_EQ(durable_next_seq_, 1100U);
  EXPECT_TRUE(wait(runs_->create(robot_.id, named("after"))));
}

// The station recorded on after the backup, and acknowledged it: so the robots hold it no more.
TEST_F(RestoreTest, WhatWasRecordedAfterTheBackupIsLostByTheRestore) {
  record_and_back_up();
  clock_.run_for(1s);
  storage::restore_database(from_, new_folder_, {"cli:root", "", clock_.utc_us()});
  use_restored();
  start();
  robot_.next_seq = 5000;
  robot_.oldest_seq = 4800;
  robot_.next_event_seq = robot_.oldest_event_seq = 3;
  connect(robot_);
  send(robot_, 4800, 200);
  TestRobot unknown;  // came after the backup
  unknown.id = "dory";
  unknown.boot_id = 7;
  unknown.next_seq = 700;
  unknown.oldest_seq = 500;
  connect(unknown);
  send(unknown, 500, 200);
  flush();
  EXPECT_EQ(rows("SELECT robot_id, first_seq, last_seq, cause FROM robot_gap"),
            (std::vector<std::string>{"nemo|1000|4799|restore", "dory|0|499|restore"}));
  EXPECT_EQ(rows("SELECT first_event_seq, last_event_seq, cause FROM event_gap"),
            std::vector<std::string>{"0|2|restore"});
}

TEST_F(RestoreTest, WhatIsLostLaterIsNotLostByTheRestore) {
  record_and_back_up();
  clock_.run_for(1s);
  storage::restore_database(from_, new_folder_, {"cli:root", "", clock_.utc_us()});
  use_restored();
  start();
  connect(robot_);
  make(robot_, 100);
  disconnect(robot_);
  robot_.next_seq = robot_.oldest_seq = 2000;
  connect(robot_);
  make(robot_, 100);
  flush();
  stop();
  start();
  robot_.next_seq = robot_.oldest_seq = 3000;
  connect(robot_);
  make(robot_, 100);
  clock_.run_for(100s);
  TestRobot young;
  young.id = "dory";
  young.boot_id = 7;
  young.next_seq = young.oldest_seq = 700;
  connect(young);
  make(young, 100);
  flush();
  EXPECT_EQ(rows("SELECT robot_id, first_seq, last_seq, cause FROM robot_gap"),
            (std::vector<std::string>{"nemo|1100|1999|ring_overrun", "nemo|2100|2999|ring_overrun",
                                      "dory|0|699|ring_overrun"}));
}

TEST_F(RestoreTest, WhatWasMissingOfABootThatHasEndedSinceIsLostByTheRestore) {
  start();
  connect(robot_);
  make(robot_, 100);
  robot_.next_seq = 120;  // 100 to 119 are late
  make(robot_, 80);
  flush();
  EXPECT_TRUE(wait(recording_->backups.begin("b")));
  EXPECT_TRUE(clock_.run_until([&] { return !recording_->backups.busy(); }, 60s));
  stop();
  clock_.run_for(1s);
  storage::restore_database(from_, new_folder_, {"cli:root", "", clock_.utc_us()});
  use_restored();
  start();
  for (int boot = 0; boot < 2; ++boot) {
    robot_.boot_id += 1;
    robot_.next_seq = robot_.oldest_seq = 0;
    connect(robot_);
    make(robot_, 10);
    robot_.next_seq += 5;
    make(robot_, 10);
    flush();
  }
  EXPECT_EQ(rows("SELECT boot_key, first_seq, last_seq, cause FROM gap"),
            (std::vector<std::string>{"1|100|119|restore", "2|10|14|reboot"}));
}

TEST_F(RestoreTest, RefusesWhereThereIsADatabase) {
  record_and_back_up();
  std::ofstream{new_folder_ / "station.sqlite"} << "precious";
  EXPECT_THAT(refusal(from_), HasSubstr("station.sqlite' is there; move it away"));
  std::ifstream in{new_folder_ / "station.sqlite"};
  EXPECT_EQ((std::string{std::istreambuf_iterator<char>{in}, {}}), "precious");
}

TEST_F(RestoreTest, RefusesWhatIsNoBackupAndLeavesNothing) {
  record_and_back_up();
  EXPECT_THAT(refusal(folder_ / "no.sqlite"), HasSubstr("there is no such file"));
  std::ofstream{folder_ / "empty.sqlite"}.flush();
  EXPECT_THAT(refusal(folder_ / "empty.sqlite"), HasSubstr("it is empty"));
  SQLite::Database{(folder_ / "theirs.sqlite").string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE}.exec(
      "CREATE TABLE theirs (x)");
  EXPECT_THAT(refusal(folder_ / "theirs.sqlite"), HasSubstr("belongs to another program"));
  SQLite::Database{(folder_ / "blank.sqlite").string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE}.exec("VACUUM");
  EXPECT_THAT(refusal(folder_ / "blank.sqlite"), HasSubstr("nothing was restored"));
  EXPECT_TRUE(fs::is_empty(new_folder_));
}

TEST_F(RestoreTest, RefusesADamagedBackupAndLeavesNothing) {
  record_and_back_up();
  path_ = from_;
  const std::int64_t page = number("SELECT rootpage FROM sqlite_master WHERE name = 'segment_by_seq'");
  std::fstream file{from_, std::ios::binary | std::ios::in | std::ios::out};
  file.seekp((page - 1) * 4096);
  file << std::string(4096, '\xff');
  file.close();
  EXPECT_THAT(refusal(from_), HasSubstr("nothing was restored"));
  EXPECT_TRUE(fs::is_empty(new_folder_));
}

TEST_F(RestoreTest, TakesADatabaseWhoseLogIsBesideIt) {
  start();
  connect(robot_);
  make(robot_, 300);
  flush();
  EXPECT_EQ(storage::restore_database(path_, new_folder_, {"cli:root", "", 1234}).samples, 300);
}

}  // namespace
}  // namespace server
