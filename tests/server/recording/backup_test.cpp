// A backup of the live database is whole, verified, and never in the way of the recording.
#include "server/storage/upkeep/backup.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>

#include "server/storage/database/file_check.hpp"
#include "tests/server/another_user.hpp"
#include "tests/server/recording/recording_test.hpp"
#include "tests/server/recording/stored_runs.hpp"

namespace server {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class BackupTest : public RecordingTest {
 protected:
  void begin(config::RecordingConfig config = {}) {
    config.low_space_mb = config.critical_space_mb = 0;
    start({}, config);
    connect(robot_);
  }
  storage::BackupRecord record_of(const std::string& name) {
    for (const storage::BackupRecord& record : wait(recording_->backups.list())) {
      if (record.name == name) return record;
    }
    return {};
  }
  storage::BackupRecord back_up(const std::string& name) {
    const Result<storage::BackupRecord> begun = wait(recording_->backups.begin(name));
    EXPECT_TRUE(begun) << begun.error().detail;
    const auto ended = [&] {
      const storage::BackupState state = record_of(name).state;
      return state == storage::BackupState::done || state == storage::BackupState::failed;
    };
    EXPECT_TRUE(clock_.run_until([&] { return !recording_->backups.busy(); }, 600s));
    EXPECT_TRUE(ended());
    return record_of(name);
  }
  ErrorCode refusal(const std::string& name) {
    const auto begun = wait(recording_->backups.begin(name));
    return begun ? ErrorCode::internal : begun.error().code;
  }
  std::vector<std::string> files(const fs::path& folder) {
    std::vector<std::string> names;
    for (const fs::directory_entry& entry : fs::directory_iterator{folder}) names.push_back(entry.path().filename());
    return names;
  }

  TestRobot robot_;
};

TEST_F(BackupTest, AFolderOfAnotherUserIsRefusedWithItsOwner) {
  if (!may_be_another_user()) GTEST_SKIP() << "only root can be somebody else";
  config::RecordingConfig config;
  config.backup_dir = folder_ / "disk";
  fs::create_directory(folder_ / "disk");
  fs::permissions(folder_, fs::perms{0755});
  begin(config);
  const AnotherUser nobody;
  const auto begun = wait(recording_->backups.begin("monday"));
  ASSERT_FALSE(begun);
  EXPECT_EQ(begun.error().code, ErrorCode::unavailable);
  EXPECT_THAT(begun.error().detail, HasSubstr("no backup can be written into '" + (folder_ / "disk").string() + "'"));
  EXPECT_THAT(begun.error().detail, HasSubstr("belongs to root (mode 0755), and this program runs as nobody"));
}

TEST_F(BackupTest, HoldsEverythingThatWasDurableAndNeedsNoFileBesideIt) {
  begin();
  const storage::RunId run = wait(runs_->create(robot_.id, named("kept")))->id;
  make(robot_, 1000);
  ASSERT_TRUE(wait(runs_->end(run, "good")));
  const storage::BackupRecord made = back_up("monday");
  ASSERT_EQ(made.state, storage::BackupState::done) << made.problem;
  EXPECT_EQ(made.path, folder_ / "backups" / "monday.sqlite");
  EXPECT_EQ(made.pages_done, made.pages_total);
  EXPECT_GT(made.pages_total, 10U);
  EXPECT_THAT(files(folder_ / "backups"), ::testing::ElementsAre("monday.sqlite"));

  SQLite::Database copy{made.path.string(), SQLite::OPEN_READONLY};
  EXPECT_EQ(copy.execAndGet("PRAGMA journal_mode").getString(), "delete");
  EXPECT_EQ(storage::find_damage(copy), "");
  EXPECT_THAT(coverage_faults(copy), IsEmpty());
  SQLite::Database live = storage::open_for_reading(path_);
  EXPECT_EQ(stored_runs(copy), stored_runs(live));
  EXPECT_THAT(files(folder_ / "backups"), ::testing::ElementsAre("monday.sqlite"));
}

TEST_F(BackupTest, UnderLoadItNeverBeginsAgainAndHoldsWhatWasDurableWhenTheCopyEnded) {
  begin();
  for (int i = 0; i < 30; ++i) {
    make(robot_, 20'000, 25);
    flush();
  }
  ASSERT_TRUE(wait(recording_->backups.begin("busy")));
  std::uint64_t pages_before = 0;
  std::uint64_t durable_before = 0;
  int looks = 0;
  while (recording_->backups.busy()) {
    const storage::BackupRecord now = record_of("busy");
    if (now.state != storage::BackupState::copying) break;
    ASSERT_GE(now.pages_done, pages_before) << "it began again";
    pages_before = now.pages_done;
    durable_before = durable_next_seq_;
    ASSERT_LT(++looks, 100) << "it begins again and again";
    make(robot_, 400, 25);  // 20,000 samples a second
    flush();
    clock_.run_for(10ms);
    wait(recorder_->on_disk([](storage::Database& database) {  // as the checkpoints of the station
      sqlite3_wal_checkpoint_v2(database.handle().getHandle(), nullptr, SQLITE_CHECKPOINT_PASSIVE, nullptr, nullptr);
      return true;
    }));
  }
  EXPECT_GT(looks, 2);
  ASSERT_TRUE(clock_.run_until([&] { return !recording_->backups.busy(); }, 600s));
  const storage::BackupRecord made = record_of("busy");
  ASSERT_EQ(made.state, storage::BackupState::done) << made.problem;
  SQLite::Database copy{made.path.string(), SQLite::OPEN_READONLY};
  EXPECT_EQ(storage::find_damage(copy), "");
  EXPECT_THAT(coverage_faults(copy), IsEmpty());
  EXPECT_GT(durable_before, 600'000U);
  EXPECT_GE(copy.execAndGet("SELECT max(last_seq) + 1 FROM segment").getInt64(),
            static_cast<std::int64_t>(durable_before));
}

TEST_F(BackupTest, NamesThatAreNoneTakenOrUnderWayAreRefused) {
  begin();
  for (const char* name : {"", ".", "../up", ".hidden", "a/b", "-x", "white space", "ümlaut"}) {
    EXPECT_EQ(refusal(name), ErrorCode::invalid) << name;
  }
  EXPECT_EQ(refusal(std::string(65, 'a')), ErrorCode::invalid);
  make(robot_, 200'000, 25);
  flush();
  ASSERT_TRUE(wait(recording_->backups.begin("one")));
  EXPECT_EQ(refusal("two"), ErrorCode::conflict);
  ASSERT_TRUE(clock_.run_until([&] { return !recording_->backups.busy(); }, 60s));
  EXPECT_EQ(refusal("one"), ErrorCode::conflict);
  EXPECT_EQ(back_up("two").state, storage::BackupState::done);
}

TEST_F(BackupTest, TheFolderIsListedAfterARestart) {
  begin();
  back_up("one");
  back_up("two");
  stop();
  const std::string part = fmt::format("three.sqlite.part-{:016x}", restored_.store_id);
  const std::string foreign = fmt::format("three.sqlite.part-{:016x}", restored_.store_id + 1);
  for (const std::string& name : {part, part + "-journal", foreign}) {
    std::ofstream{folder_ / "backups" / name} << "cut off";
  }
  begin();
  std::vector<std::string> names;
  for (const storage::BackupRecord& record : wait(recording_->backups.list())) names.push_back(record.name);
  EXPECT_THAT(names, ::testing::ElementsAre("one", "two"));
  EXPECT_EQ(record_of("one").state, storage::BackupState::done);
  EXPECT_GT(record_of("one").pages_total, 10U);
  back_up("three");
  // Another station is making the foreign one.
  EXPECT_THAT(files(folder_ / "backups"),
              ::testing::UnorderedElementsAre("one.sqlite", "two.sqlite", "three.sqlite", foreign));
}

// A station that begins a backup leaves that of another, which is being made, alone.
TEST_F(BackupTest, StationsMayHaveOneFolder) {
  const fs::path common = folder_ / "common";
  fs::create_directories(common);
  config::RecordingConfig config;
  config.backup_dir = common;
  begin(config);
  for (int i = 0; i < 20; ++i) {
    make(robot_, 20'000, 25);
    flush();
  }
  ASSERT_TRUE(wait(recording_->backups.begin("monday")));
  const auto is_part = [](const std::string& name) { return name.contains(".part-"); };
  ASSERT_TRUE(clock_.run_until([&] { return std::ranges::any_of(files(common), is_part); }, 10s));

  storage::RecordingParts other{loop_,
                                clock_,
                                disk_,
                                readers_,
                                exports_worker_,
                                checkpoints_,
                                storage::RecorderOptions{folder_ / "other.sqlite", {}},
                                config};
  clock_.add_worker(other.backups.checker());
  wait(other.open());
  other.spawn(*tasks_);
  ASSERT_TRUE(recording_->backups.busy());
  ASSERT_TRUE(wait(other.backups.begin("tuesday")));
  ASSERT_TRUE(clock_.run_until([&] { return !recording_->backups.busy() && !other.backups.busy(); }, 600s));
  EXPECT_EQ(record_of("monday").state, storage::BackupState::done) << record_of("monday").problem;
  EXPECT_THAT(files(common), ::testing::UnorderedElementsAre("monday.sqlite", "tuesday.sqlite"));
  stop();
  clock_.remove_worker(other.backups.checker());
  other.close();
}

TEST_F(BackupTest, AFolderThatCannotBeMadeFailsTheBackupOnly) {
  std::ofstream{folder_ / "backups"} << "a file";
  begin();
  EXPECT_EQ(refusal("one"), ErrorCode::unavailable);
  make(robot_, 300);
  flush();
  EXPECT_EQ(durable_next_seq_, 300U);
}

TEST_F(BackupTest, AStationThatStopsMeanwhileClosesItsDatabase) {
  begin();
  for (int i = 0; i < 20; ++i) {
    make(robot_, 20'000, 25);
    flush();
  }
  ASSERT_TRUE(wait(recording_->backups.begin("cut")));
  clock_.run_for(30ms);
  ASSERT_EQ(record_of("cut").state, storage::BackupState::copying);
  stop();
  EXPECT_FALSE(fs::exists(folder_ / "backups" / "cut.sqlite"));
  EXPECT_FALSE(fs::exists(fs::path{path_}.concat("-wal"))) << "closed, and its log emptied";
  begin();
  EXPECT_EQ(back_up("cut").state, storage::BackupState::done);
}

}  // namespace
}  // namespace server
