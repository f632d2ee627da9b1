// A station that removes what is old or too much, and words to say what it has removed.
#pragma once

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "server/storage/upkeep/purge.hpp"
#include "tests/server/recording/recording_test.hpp"
#include "tests/server/recording/stored_runs.hpp"

namespace server {

constexpr microseconds kDay = 24h;

class RetentionTest : public RecordingTest {
 protected:
  using Rows = std::vector<std::string>;

  void keep(std::uint32_t days, std::uint32_t megabytes = 0, std::uint32_t event_days = 0) {
    start({}, {.retention_days = days,
               .event_retention_days = event_days,
               .max_database_mb = megabytes,
               .low_space_mb = 0,
               .critical_space_mb = 0,
               .backup_dir = {},
               .give_up_after_days = 0});
    connect(robot_);
  }
  // What is recorded now grows this old; the station looks at it in between.
  void age(microseconds by) {
    clock_.skip(2h);
    wait(recording_->retention.pass());
    clock_.skip(by);
  }
  void start_again(std::uint32_t days) {
    stop();
    keep(days);
  }
  // Samples that are on disk; the recorder has noted in the database that they are.
  void record(std::size_t count) {
    make(robot_, count, 25);
    flush();
  }
  void set_durable(station::BootId boot_id, std::uint64_t next_seq) {
    execute(fmt::format("UPDATE boot SET durable_next_seq = {} WHERE boot_id = {}", next_seq, signed_id_of(boot_id)));
  }
  void execute(const std::string& sql) {
    wait(recorder_->on_disk([sql](storage::Database& database) { return database.handle().exec(sql); }));
  }
  static std::int64_t signed_id_of(station::BootId boot_id) { return static_cast<std::int64_t>(boot_id); }
  void pass() {
    wait(recording_->retention.pass());
    SQLite::Database database = storage::open_for_reading(path_);
    EXPECT_THAT(coverage_faults(database), ::testing::IsEmpty());
    EXPECT_EQ(rows("PRAGMA integrity_check"), Rows{"ok"});
  }
  std::map<std::int64_t, std::vector<std::string>> runs() {
    SQLite::Database database = storage::open_for_reading(path_);
    return stored_runs(database);
  }
  // Of everything that may go, whatever its age.
  storage::RetentionPlan planned() {
    SQLite::Database database = storage::open_for_reading(path_);
    storage::RetentionPlan plan{std::nullopt};
    while (plan.look(database)) continue;
    return plan;
  }
  void carry_out(storage::RetentionPlan& plan) {
    auto step = [&](storage::Database& database) {
      return purge_step(database.handle(), plan, clock_, clock_.utc_us());
    };
    while (!plan.empty()) wait(recorder_->on_disk(step));
  }
  Rows gaps() { return rows("SELECT first_seq, last_seq, cause FROM gap ORDER BY boot_key, first_seq"); }
  std::int64_t samples() { return number("SELECT count(*) FROM sample"); }
  const storage::RetentionCounters& counters() const { return recording_->retention.counters(); }

  TestRobot robot_;
};

}  // namespace server
