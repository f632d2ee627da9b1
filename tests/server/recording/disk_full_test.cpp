// A real disk that is full: two small tmpfs, in a mount namespace of this program alone. Where the machine allows no
// such namespace the tests are skipped, with that reason.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <stdlib.h>
#include <sys/mount.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "server/storage/database/disk_reserve.hpp"
#include "server/storage/database/schema.hpp"
#include "tests/server/recording/recording_test.hpp"
#include "tests/server/recording/schema_dump.hpp"
#include "tests/server/recording/stored_runs.hpp"

namespace server {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr const char* kInside = "RHEONAUT_SMALL_DISKS";  // set in the namespace: the folder of the disks

fs::path disk() { return fs::path{std::getenv(kInside)} / "data"; }
fs::path other_disk() { return fs::path{std::getenv(kInside)} / "backups"; }

// Takes all the room that is left.
class Filler {
 public:
  explicit Filler(const fs::path& folder) : path_{folder / "filler"} {
    std::ofstream out{path_, std::ios::binary};
    const std::string block(4096, 'x');
    while (out.write(block.data(), static_cast<std::streamsize>(block.size())).flush()) continue;
  }
  ~Filler() { remove(); }
  void remove() const { fs::remove(path_); }

 private:
  fs::path path_;
};

class DiskFullTest : public RecordingTest {
 protected:
  void SetUp() override {
    if (std::getenv(kInside) == nullptr) GTEST_SKIP() << "unshare -rm is not possible here: no small disk";
    config::RecordingConfig config;
    config.low_space_mb = 8;
    config.critical_space_mb = 2;
    config.backup_dir = other_disk();
    start({}, config);
    connect(robot_);
  }
  void record(std::size_t count) {
    make(robot_, count, 25);
    flush();
  }
  storage::BackupRecord ended_backup(const std::string& name) {
    EXPECT_TRUE(clock_.run_until([&] { return !recording_->backups.busy(); }, 60s));
    for (const storage::BackupRecord& record : wait(recording_->backups.list())) {
      if (record.name == name) return record;
    }
    return {};
  }
  void expect_whole() {
    SQLite::Database database = storage::open_for_reading(path_);
    EXPECT_THAT(coverage_faults(database), IsEmpty());
    EXPECT_EQ(rows("PRAGMA integrity_check"), std::vector<std::string>{"ok"});
  }

  TestRobot robot_;
};

TEST_F(DiskFullTest, RecordingWaitsCommandsLiveAndAllIsStoredWhenThereIsRoomAgain) {
  record(5000);
  {
    const Filler filler{disk()};
    make(robot_, 20'000, 25);
    clock_.run_for(10s);
    EXPECT_TRUE(recorder_->failing());
    EXPECT_THAT(recorder_->problem(), HasSubstr("Make room on the disk"));
    EXPECT_EQ(recording_->disk_watch.state(), storage::SpaceState::critical);
    EXPECT_FALSE(recording_->disk_watch.may_begin("a run"));
    EXPECT_FALSE(wait(recording_->backups.begin("no")));
    EXPECT_EQ(durable_next_seq_, 5000U) << "what is not on disk is not acknowledged";

    station::CommandRecord stop;
    stop.id = 77;
    stop.robot_id = robot_.id;
    stop.kind = "emergency_stop";
    recorder_->on_command(stop);
    disconnect(robot_);
    EXPECT_EQ(admit(robot_).refusal, rheonaut_REFUSAL_REASON_NONE) << "a robot can come back, so it can be stopped";
    connect(robot_);
  }
  clock_.run_for(10s);
  EXPECT_FALSE(recorder_->failing());
  EXPECT_EQ(recorder_->problem(), "");
  EXPECT_EQ(recording_->disk_watch.state(), storage::SpaceState::ok);
  EXPECT_EQ(durable_next_seq_, 25'000U);
  EXPECT_EQ(number("SELECT count(*) FROM command WHERE command_id = 77"), 1);
  EXPECT_EQ(recorder_->counters().samples_lost, 0U);
  EXPECT_TRUE(wait(runs_->create(robot_.id, named("after"))));
  expect_whole();
}

TEST_F(DiskFullTest, ARestartOnAFullDiskHasAllThatWasAcknowledged) {
  record(5000);
  const std::uint64_t acknowledged = durable_next_seq_;
  ASSERT_TRUE(wait(runs_->create(robot_.id, named("open"))));
  station::CommandRecord unfinished;
  unfinished.id = 76;
  unfinished.robot_id = robot_.id;
  unfinished.kind = "set_mode";
  recorder_->on_command(unfinished);
  wait(recorder_->flush_records());
  fs::remove(storage::disk_reserve_of(path_));  // the least that a start may find
  {
    const Filler filler{disk()};
    make(robot_, 5000, 25);
    clock_.run_for(3s);
    kill();
    start();  // SAFETY: the station is there, so that robots can be stopped
    EXPECT_GE(admit(robot_).durable_next_seq, acknowledged);
    EXPECT_EQ(number("SELECT count(*) FROM run WHERE state IN ('open', 'interrupted')"), 1)
        << "as far as there is room";
  }
  clock_.run_for(3s);
  EXPECT_EQ(number("SELECT count(*) FROM run WHERE state = 'interrupted'"), 1) << "once there is room";
  kill();
  start();
  EXPECT_GE(admit(robot_).durable_next_seq, acknowledged);
  expect_whole();
}

TEST_F(DiskFullTest, ARestartOnAFullDiskUsesTheRoomThatWasKeptForIt) {
  record(5000);
  ASSERT_TRUE(fs::exists(storage::disk_reserve_of(path_)));
  {
    const Filler filler{disk()};
    kill();
    start();
    EXPECT_FALSE(fs::exists(storage::disk_reserve_of(path_)));
    EXPECT_GE(admit(robot_).durable_next_seq, durable_next_seq_);
  }
  clock_.run_for(6s);
  EXPECT_TRUE(fs::exists(storage::disk_reserve_of(path_))) << "kept again for the next start";
  expect_whole();
}

TEST_F(DiskFullTest, WhereTheBackupsDiskIsFullOnlyTheBackupFails) {
  record(200'000);
  ASSERT_TRUE(wait(recording_->backups.begin("one")));
  {
    const Filler filler{other_disk()};
    record(5000);
    const storage::BackupRecord failed = ended_backup("one");
    EXPECT_EQ(failed.state, storage::BackupState::failed);
    EXPECT_NE(failed.problem, "");
    EXPECT_FALSE(recorder_->failing());
    EXPECT_EQ(durable_next_seq_, 205'000U);
  }
  EXPECT_TRUE(fs::is_empty(other_disk())) << "nothing is left of it";
  ASSERT_TRUE(wait(recording_->backups.begin("one")));
  const storage::BackupRecord made = ended_backup("one");
  EXPECT_EQ(made.state, storage::BackupState::done) << made.problem;
  fs::remove(made.path);
  expect_whole();
}

TEST_F(DiskFullTest, WhereABackupCannotFitItDoesNotBegin) {
  record(20'000);
  const Filler filler{other_disk()};
  const auto begun = wait(recording_->backups.begin("one"));
  ASSERT_FALSE(begun);
  EXPECT_EQ(begun.error().reason, "low_space");
}

TEST_F(DiskFullTest, ADatabaseOfAnOlderSchemaStaysAsItIsWhereACopyOfItDoesNotFit) {
  kill();
  fs::remove_all(folder_);
  fs::create_directories(folder_);
  make_database(path_, "version_6.sql");
  {
    SQLite::Database as_a_station_leaves_it{path_.string(), SQLite::OPEN_READWRITE};
    as_a_station_leaves_it.exec("PRAGMA journal_mode = WAL");
  }
  const fs::path kept = folder_ / "kept";
  std::ofstream{kept, std::ios::binary} << std::string(500'000, 'x');
  {
    const Filler filler{disk()};
    fs::remove(kept);
    try {
      const storage::Database database{path_};
      ADD_FAILURE() << "it was migrated without a copy";
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(),
                  HasSubstr("from schema 6 to the present one: a copy of it is kept first, which needs 1."));
      EXPECT_THAT(error.what(), HasSubstr(" MB, and 0.5 MB are free in " + folder_.string()));
      EXPECT_THAT(error.what(), HasSubstr("Make room there"));
    }
    EXPECT_EQ(number("PRAGMA user_version"), 6);
    EXPECT_EQ(rows("PRAGMA integrity_check"), std::vector<std::string>{"ok"});
  }
  const storage::Database database{path_};
  EXPECT_TRUE(fs::exists(folder_ / "station.sqlite.schema-6"));
}

TEST_F(DiskFullTest, ADatabaseOfAnOlderSchemaStaysAsItIsWhereItsMigrationDoesNotFit) {
  kill();
  fs::remove_all(folder_);
  fs::create_directories(folder_);
  make_database(path_, "version_6.sql");
  const fs::path kept = folder_ / "kept";
  std::ofstream{kept, std::ios::binary} << std::string(100'000, 'x');
  {
    const Filler filler{disk()};
    fs::remove(kept);
    try {
      const storage::Database database{path_, storage::BeforeMigration::change_in_place};
      ADD_FAILURE() << "it was migrated on a full disk";
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(),
                  HasSubstr("from schema 6 to the present one: the disk became full. The database has 0."));
      EXPECT_THAT(error.what(), HasSubstr(" MB: make room for as much again in " + folder_.string()));
    }
    EXPECT_EQ(number("PRAGMA user_version"), 6);
    EXPECT_EQ(rows("PRAGMA integrity_check"), std::vector<std::string>{"ok"});
  }
  const storage::Database database{path_};
  EXPECT_EQ(number("PRAGMA user_version"), static_cast<std::int64_t>(storage::migrations().size()));
}

// Mounts the disks and makes the first of them the folder of temporary files.
void mount_disks(const fs::path& folder) {
  const auto mount_one = [](const fs::path& at, const char* options) {
    fs::create_directories(at);
    if (::mount("tmpfs", at.c_str(), "tmpfs", 0, options) != 0) throw std::runtime_error{"cannot mount " + at.string()};
  };
  mount_one(folder / "data", "size=24m");
  mount_one(folder / "backups", "size=8m");
  ::setenv("TMPDIR", (folder / "data").c_str(), 1);
}

// This program once more, in a namespace where it may mount. Returns when that is not possible.
void enter_namespace(char** argv) {
  if (std::system("unshare -rm true 2>/dev/null") != 0) return;
  const fs::path program = fs::read_symlink("/proc/self/exe");
  ::setenv(kInside, fs::path{program}.concat(".disks").c_str(), 1);
  std::vector<char*> words;
  std::string unshare = "unshare", flags = "-rm", path = program.string();
  for (std::string* word : {&unshare, &flags, &path}) words.push_back(word->data());
  for (char** word = argv + 1; *word != nullptr; ++word) words.push_back(*word);
  words.push_back(nullptr);
  ::execvp("unshare", words.data());
  ::unsetenv(kInside);
}

}  // namespace
}  // namespace server

int main(int argc, char** argv) {
  if (std::getenv(server::kInside) == nullptr) server::enter_namespace(argv);
  if (const char* folder = std::getenv(server::kInside)) server::mount_disks(folder);
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
