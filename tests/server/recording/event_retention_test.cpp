// Old events go, and it is recorded how many and of when; those of runs stay, and so does what shows the latch.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "server/storage/upkeep/audit_check.hpp"
#include "server/storage/upkeep/event_purge.hpp"
#include "tests/server/recording/retention_fixture.hpp"

namespace server {
namespace {

using ::testing::IsEmpty;

class EventRetentionTest : public RetentionTest {
 protected:
  void keep_events(std::uint32_t days) { keep(0, 0, days); }
  void event(const char* kind, std::uint64_t sample_seq = 0) {
    station::RobotEvent made;
    made.robot_id = robot_.id;
    made.boot_id = robot_.boot_id;
    made.event_seq = robot_.next_event_seq++;
    made.sample_seq = sample_seq;
    made.robot_time_us = robot_.time_of(sample_seq);
    made.kind = kind;
    made.received_at_us = clock_.utc_us();
    recorder_->on_event(state_of(robot_, station::LinkState::connected), made);
    wait(recorder_->flush_records());
  }
  void note_of_station(const char* kind) {
    station::RobotEvent made;
    made.robot_id = robot_.id;
    made.kind = kind;
    made.received_at_us = clock_.utc_us();
    recorder_->on_event(state_of(robot_, station::LinkState::connected), made);
    wait(recorder_->flush_records());
  }
  Rows events() { return rows("SELECT event_seq, kind FROM event ORDER BY event_row"); }
  Rows event_gaps() {
    return rows("SELECT first_event_seq, last_event_seq, cause FROM event_gap ORDER BY boot_key, first_event_seq");
  }
  Rows removals() {
    return rows(
        "SELECT json_extract(detail, '$.count'), json_extract(detail, '$.to_us')"
        " - json_extract(detail, '$.from_us') FROM audit WHERE action = 'retention.events_removed'");
  }
  void age_a_week_and_pass() {
    age(8 * kDay);
    event("mode_changed");
    pass();
  }
};

TEST_F(EventRetentionTest, RemovesWhatIsOldAndRecordsHowManyAndOfWhen) {
  keep_events(7);
  for (int n = 0; n < 10; ++n) {
    event("setpoint_changed");
    clock_.run_for(1s);
  }
  note_of_station("connected");
  const std::int64_t first_us = number("SELECT min(received_at_us) FROM event");
  const std::int64_t last_us = number("SELECT max(received_at_us) FROM event");
  age_a_week_and_pass();
  EXPECT_EQ(events(), Rows{"10|mode_changed"});
  EXPECT_EQ(event_gaps(), Rows{"0|9|retention"});
  EXPECT_EQ(removals(), Rows{fmt::format("11|{}", last_us - first_us)});
  EXPECT_EQ(counters().events_purged, 11U);
  stop();
  SQLite::Database database = storage::open_for_reading(path_);
  EXPECT_THAT(storage::check_audit(database, {}).faults, IsEmpty());
}

TEST_F(EventRetentionTest, WithoutALimitEventsStay) {
  keep(7);
  event("setpoint_changed");
  age_a_week_and_pass();
  EXPECT_EQ(events().size(), 2U);
  EXPECT_THAT(removals(), IsEmpty());
}

TEST_F(EventRetentionTest, ARunKeepsItsEventsUntilItIsDiscarded) {
  keep_events(7);
  record(100);
  event("setpoint_changed", 50);
  const storage::RunId run = wait(runs_->create(robot_.id, named("kept")))->id;
  record(100);
  event("setpoint_changed", 150);
  note_of_station("disconnected");
  wait(runs_->end(run, ""));
  clock_.run_for(1s);
  note_of_station("connected");
  event("setpoint_changed", 210);
  const auto before = runs();
  age_a_week_and_pass();
  EXPECT_EQ(events(), (Rows{"1|setpoint_changed", "|disconnected", "3|mode_changed"}));
  EXPECT_EQ(event_gaps(), (Rows{"0|0|retention", "2|2|retention"}));
  EXPECT_EQ(runs(), before) << "a run and its digest are as they were";
  wait(runs_->discard(run, "not needed", {"test", "", clock_.utc_us()}));
  age(kDay);
  pass();
  EXPECT_EQ(events(), Rows{"3|mode_changed"});
  EXPECT_EQ(event_gaps(), Rows{"0|2|retention"});
}

// SAFETY: a station that starts again reads the latch of a robot from it.
TEST_F(EventRetentionTest, TheLastEventOfTheLatchStays) {
  keep_events(7);
  event("emergency");
  event("emergency_cleared");
  event("emergency");
  event("setpoint_changed");
  age_a_week_and_pass();
  EXPECT_EQ(events(), (Rows{"2|emergency", "4|mode_changed"}));
}

TEST_F(EventRetentionTest, WhatWasRemovedIsNeitherAskedForAgainNorLost) {
  keep_events(7);
  for (int n = 0; n < 5; ++n) event("setpoint_changed");
  age_a_week_and_pass();
  stop();
  keep_events(7);
  clock_.run_for(5s);
  EXPECT_EQ(missing_events_, 0);
  robot_.boot_id += 1;  // it ends the boot before
  connect(robot_);
  wait(recorder_->flush());
  EXPECT_EQ(event_gaps(), Rows{"0|4|retention"});
}

TEST_F(EventRetentionTest, AClockThatIsSetMakesNothingOld) {
  keep_events(7);
  event("setpoint_changed");
  clock_.step_utc(400 * kDay);
  event("setpoint_changed");
  pass();
  EXPECT_EQ(events().size(), 2U);
}

TEST_F(EventRetentionTest, AStepEndsInTimeAndTheNextGoesOn) {
  keep_events(7);
  wait(recorder_->flush_boots());
  execute(
      "INSERT INTO event (robot_id, boot_key, event_seq, robot_time_us, sample_seq, kind, cause, mode, sub_state,"
      " emergency_id, command_id, received_at_us) WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n"
      " WHERE i < 19999) SELECT 'nemo', boot_key, i, 0, 0, 'setpoint_changed', 'none', 'manual', 'none', 0, 0, i"
      " FROM n, boot");
  execute("UPDATE boot SET durable_next_event_seq = 20000");
  storage::EventPurge purge{{.row = 20'001, .earlier_row = 0, .received_before_us = 0}};
  auto step = [&](storage::Database& database) { return purge.step(database.handle(), clock_, clock_.utc_us()); };
  int steps = 0;
  for (; !purge.is_done(); ++steps) EXPECT_LE(wait(recorder_->on_disk(step)), 5'000U);
  EXPECT_GE(steps, 4);
  EXPECT_THAT(events(), IsEmpty());
  EXPECT_EQ(event_gaps(), Rows{"0|19999|retention"});
}

}  // namespace
}  // namespace server
