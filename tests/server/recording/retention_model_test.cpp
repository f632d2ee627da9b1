// Random recordings, runs, discards, purges, restarts and VACUUMs: what a run shows never changes, and every sample is
// in exactly one segment or gap.
#include <gmock/gmock.h>

#include <cstdlib>
#include <random>
#include <utility>

#include "tests/server/recording/recording_test.hpp"
#include "tests/server/recording/stored_runs.hpp"

namespace server {
namespace {

using ::testing::IsEmpty;

class RetentionModelTest : public RecordingTest, public ::testing::WithParamInterface<unsigned> {
 protected:
  void begin() {
    const bool by_size = GetParam() % 2 == 0;
    config::RecordingConfig config;
    config.retention_days = by_size ? 0 : 3;
    config.max_database_mb = by_size ? 1 : 0;
    start({}, config);
    for (TestRobot& robot : robots_) connect(robot);
  }

  void act() {
    TestRobot& robot = robots_[pick(robots_.size())];
    switch (pick(10)) {
      case 0: let_pass(static_cast<int>(pick(48))); break;
      case 1: robot.context.setpoint_m = static_cast<float>(pick(3)); break;
      case 2: robot.next_seq = robot.oldest_seq = robot.next_seq + pick(60); break;  // its ring lost some
      case 3: reboot(robot); break;
      case 4: begin_or_end_run(robot); break;
      case 5: discard_a_run(); break;
      default: make(robot, 1 + pick(3000), 25);
    }
  }

  // And the clock is set, too, to a day ahead or back: that makes nothing older.
  void let_pass(int hours) {
    clock_.skip(1h * hours);
    const auto ahead = 24h * (hours % 2);
    clock_.step_utc(ahead - std::exchange(ahead_, ahead));
  }

  void reboot(TestRobot& robot) {
    if (pick(3) != 0) return;
    disconnect(robot);
    robot.boot_id += 1;
    robot.next_seq = robot.oldest_seq = 0;
    connect(robot);
  }

  void begin_or_end_run(TestRobot& robot) {
    const auto open = rows("SELECT run_id FROM run WHERE ended_at_us IS NULL AND robot_id = '" + robot.id + "'");
    if (open.empty()) {
      ASSERT_TRUE(wait(runs_->create(robot.id, named("random"))));
    } else {
      ASSERT_TRUE(wait(runs_->end(std::stoll(open.front()), "")));
    }
  }

  void discard_a_run() {
    const auto ended = rows("SELECT run_id FROM run WHERE state IN ('ended', 'interrupted')");
    if (ended.size() < 3) return;
    execute("UPDATE run SET state = 'discarded' WHERE run_id = " + ended[pick(ended.size())]);
  }

  void restart() {
    stop();
    if (pick(2) == 0) {
      ASSERT_EQ(std::system(("sqlite3 '" + path_.string() + "' VACUUM").c_str()), 0);
    }
    begin();
  }

  void execute(const std::string& sql) {
    wait(recorder_->on_disk([sql](storage::Database& database) { return database.handle().exec(sql); }));
  }

  std::map<std::int64_t, std::vector<std::string>> runs() {
    SQLite::Database database = storage::open_for_reading(path_);
    return stored_runs(database);
  }

  std::uint64_t pick(std::uint64_t limit) { return random_() % limit; }

  std::mt19937 random_{GetParam()};
  std::chrono::hours ahead_{0};  // of the clock
  static TestRobot robot(station::RobotId id, station::BootId boot_id) {
    TestRobot robot;
    robot.id = std::move(id);
    robot.boot_id = boot_id;
    return robot;
  }

  std::vector<TestRobot> robots_{robot("nemo", 1000), robot("dory", 2000)};
};

TEST_P(RetentionModelTest, RunsStayAndEverySampleIsInOnePlace) {
  begin();
  for (int round = 0; round < 8; ++round) {
    for (int step = 0; step < 10; ++step) act();
    flush();
    const auto before = runs();
    wait(recording_->retention.pass());
    EXPECT_EQ(runs(), before) << "round " << round;
    SQLite::Database database = storage::open_for_reading(path_);
    ASSERT_THAT(coverage_faults(database), IsEmpty()) << "round " << round;
    if (pick(4) == 0) restart();
  }
  EXPECT_GT(number("SELECT count(*) FROM gap WHERE cause = 'retention'"), 0);
  EXPECT_EQ(rows("PRAGMA integrity_check"), std::vector<std::string>{"ok"});
}

TEST_P(RetentionModelTest, AVacuumByTheStockProgramChangesNoRun) {
  begin();
  for (int step = 0; step < 40; ++step) act();
  flush();
  wait(recording_->retention.pass());
  stop();
  const auto before = runs();
  ASSERT_EQ(std::system(("sqlite3 '" + path_.string() + "' VACUUM").c_str()), 0);
  EXPECT_EQ(runs(), before);
  begin();
  make(robots_.front(), 300, 25);
  flush();
  SQLite::Database database = storage::open_for_reading(path_);
  EXPECT_THAT(coverage_faults(database), IsEmpty()) << "row numbers go on where they were";
}

INSTANTIATE_TEST_SUITE_P(Seeds, RetentionModelTest, ::testing::Range(0u, 12u));

}  // namespace
}  // namespace server
