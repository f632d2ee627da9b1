// What an admission reads of a boot does not grow with the boot.
#include <sqlite3.h>

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

class LoadTest : public RecordingTest {
 protected:
  // A boot of 10 million samples, without their rows: nothing here reads a row.
  void store_long_boot() {
    SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE};
    SQLite::Transaction transaction{database};
    database.exec(
        "WITH RECURSIVE number(n) AS (VALUES (0) UNION ALL SELECT n + 1 FROM number WHERE n < 99999)"
        " INSERT INTO segment (boot_key, first_seq, last_seq, first_row, last_row, first_robot_time_us, period_us,"
        " received_at_us, utc_offset_us, clock_uncertainty_us, mode, sub_state, disturbance_m, position_sd_m,"
        " controller_id, emergency_id, emergency_cause, flags)"
        " SELECT 1, 100 * n, 100 * n + 99, 1000 + 100 * n, 1099 + 100 * n, 1000000 * n, 10000, 0, 0, 0, 'manual',"
        " 'none', 0, 0, 0, 0, 'none', 0 FROM number");
    database.exec("UPDATE boot SET durable_next_seq = 10000000");
    transaction.commit();
    robot_.next_seq = 10'000'000;
  }

  struct Work {
    int statements = 0;
    int rows = 0;
  };

  // Of the disk thread, from here on.
  void count(Work& work) {
    auto job = [&work](storage::Database& database) {
      const auto on_trace = [](unsigned kind, void* to, void*, void*) {
        Work& counted = *static_cast<Work*>(to);
        ++(kind == SQLITE_TRACE_ROW ? counted.rows : counted.statements);
        return 0;
      };
      sqlite3_trace_v2(database.handle().getHandle(), SQLITE_TRACE_STMT | SQLITE_TRACE_ROW, on_trace, &work);
    };
    wait(recorder_->on_disk(std::move(job)));
  }

  TestRobot robot_;
};

TEST_F(LoadTest, ABootOfAHundredThousandSegmentsIsLoadedWithFewRows) {
  start();
  connect(robot_);
  flush();
  kill();
  store_long_boot();
  start();
  Work work;
  count(work);
  EXPECT_EQ(admit(robot_).durable_next_seq, 10'000'000u);
  EXPECT_LE(work.statements, 13);
  EXPECT_LE(work.rows, 5);
  work = {};
  TestRobot rebooted;
  rebooted.boot_id = 5;
  connect(rebooted);  // ends the long one
  flush();
  EXPECT_LE(work.rows, 10);
  EXPECT_EQ(rows("SELECT ended_next_seq, durable_next_seq FROM boot WHERE boot_key = 1"),
            std::vector<std::string>{"10000000|10000000"});
}

TEST_F(LoadTest, ABootOfAnOlderProgramIsReadWholeOnce) {
  start();
  connect(robot_);
  make(robot_, 250);
  flush();
  kill();
  SQLite::Database{path_.string(), SQLite::OPEN_READWRITE}.exec("UPDATE boot SET durable_next_seq = 0");
  start();
  EXPECT_EQ(admit(robot_).durable_next_seq, 250u);
  connect(robot_);
  make(robot_, 10);
  flush();
  EXPECT_EQ(number("SELECT durable_next_seq FROM boot"), 260);
}

// A purge leaves a gap, and nothing is searched below what is durable.
TEST_F(LoadTest, WhatWasPurgedIsNeitherAHoleNorLost) {
  start();
  connect(robot_);
  make(robot_, 300);
  flush();
  kill();
  SQLite::Database{path_.string(), SQLite::OPEN_READWRITE}.exec(
      "DELETE FROM sample WHERE row <= 200; DELETE FROM segment WHERE last_row <= 200;"
      "INSERT INTO gap VALUES (1, 0, 199, 'retention', 1)");
  start();
  EXPECT_EQ(admit(robot_).durable_next_seq, 300u);
  connect(robot_);
  make(robot_, 10);
  TestRobot rebooted;
  rebooted.boot_id = 5;
  connect(rebooted);
  flush();
  clock_.run_for(5s);
  EXPECT_TRUE(missing_.empty());
  EXPECT_EQ(rows("SELECT first_seq, last_seq, cause FROM gap"), std::vector<std::string>{"0|199|retention"});
}

}  // namespace
}  // namespace server
