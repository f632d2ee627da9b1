// What is stored of values that are not plain: unknown to this version, no finite number, or such as cannot be.
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

using Rows = std::vector<std::string>;

class RecordedValuesTest : public RecordingTest {
 protected:
  TestRobot robot_;
};

TEST_F(RecordedValuesTest, AnEventIsStoredWithItsCauseThatOfTheLatchAndItsDetail) {
  start();
  connect(robot_);
  station::RobotEvent event;
  event.robot_id = robot_.id;
  event.boot_id = robot_.boot_id;
  event.event_seq = 0;
  event.kind = "link_lost";
  event.cause = "link_loss";
  event.emergency_cause = rheonaut_EMERGENCY_CAUSE_OPERATOR;
  event.detail = "a sentence";
  recorder_->on_event(state_of(robot_, station::LinkState::connected), event);
  wait(recorder_->flush_records());
  EXPECT_EQ(rows("SELECT kind, cause, emergency_cause, detail FROM robot_event"),
            Rows{"link_lost|link_loss|operator|a sentence"});
  const station::RobotEvent read = wait(history_->events(robot_.id, {.limit = 1})).records.at(0);
  EXPECT_EQ(read.cause, event.cause);
  EXPECT_EQ(read.emergency_cause, event.emergency_cause);
  EXPECT_EQ(read.detail, event.detail);
}

TEST_F(RecordedValuesTest, WhatARobotSaysThatIsNoFiniteNumberIsStoredAsNull) {
  start();
  connect(robot_);
  robot_.context.disturbance_m.reset();
  make(robot_, 5);
  robot_.context.position_sd_m.reset();
  make(robot_, 95);
  EXPECT_TRUE(clock_.run_until([&] { return durable_next_seq_ == 100; }, 2s));
  EXPECT_EQ(rows("SELECT first_seq, disturbance_m, position_sd_m FROM segment ORDER BY first_seq"),
            (Rows{"0||0.0", "5||"}));
}

TEST_F(RecordedValuesTest, WhatANewerFirmwareSaysIsStoredWithItsNumberAndReadBack) {
  start();
  robot_.context.mode = static_cast<protocol::Mode>(17);
  connect(robot_);
  const storage::RunId run = wait(runs_->create(robot_.id, named("newer")))->id;
  make(robot_, 100);
  station::RobotEvent event;
  event.robot_id = robot_.id;
  event.boot_id = robot_.boot_id;
  event.event_seq = 0;
  event.kind = "unknown";
  event.mode = static_cast<protocol::Mode>(17);
  event.emergency_cause = static_cast<protocol::EmergencyCause>(30);
  event.unknown_values = R"({"kind":90,"mode":17,"emergency_cause":30})";
  recorder_->on_event(state_of(robot_, station::LinkState::connected), event);
  flush();
  EXPECT_EQ(rows("SELECT DISTINCT mode, sub_state, unknown_values FROM run_sample WHERE run_id = 1"),
            Rows{R"(unknown|none|{"mode":17})"});
  EXPECT_EQ(rows("SELECT kind, mode, emergency_cause, unknown_values ->> 'kind' FROM robot_event"),
            Rows{"unknown|unknown|unknown|90"});
  const storage::SamplePage page = wait(history_->samples(run, std::nullopt, 1000)).value();
  EXPECT_EQ(static_cast<int>(page.samples.at(0).mode), 17);
  const station::RobotEvent read = wait(history_->events(robot_.id, {.limit = 1})).records.at(0);
  EXPECT_EQ(static_cast<int>(read.mode), 17);
  EXPECT_EQ(static_cast<int>(*read.emergency_cause), 30);
  EXPECT_EQ(read.unknown_values, event.unknown_values);
}

// A version before schema 7 kept the text alone: it is unknown still, and not some mode.
TEST_F(RecordedValuesTest, WhatWasStoredAsUnknownWithoutANumberStaysUnknown) {
  start();
  robot_.context.mode = static_cast<protocol::Mode>(17);
  connect(robot_);
  const storage::RunId run = wait(runs_->create(robot_.id, named("of before")))->id;
  make(robot_, 100);
  flush();
  {
    SQLite::Database database{path_.string(), SQLite::OPEN_READWRITE, 5000};
    database.exec("UPDATE segment SET unknown_values = NULL");
  }
  const storage::SamplePage page = wait(history_->samples(run, std::nullopt, 1000)).value();
  EXPECT_STREQ(protocol::text(page.samples.at(0).mode), "unknown");
}

// The acknowledgement passes over what cannot be recorded, and the robot need not send it again.
TEST_F(RecordedValuesTest, WhatCannotBeRecordedIsAFinalGap) {
  start();
  connect(robot_);
  make(robot_, 10);
  station::RobotState state = state_of(robot_, station::LinkState::connected);
  state.last_received_at_us = clock_.utc_us();
  recorder_->on_unusable_samples(state, 10, 15);
  recorder_->on_unusable_samples(state, 5, 12);  // again, with some that are stored
  recorder_->on_unusable_event(state, 0);
  robot_.next_seq = 15;
  make(robot_, 85);
  station::RobotEvent event;
  event.robot_id = robot_.id;
  event.boot_id = robot_.boot_id;
  event.event_seq = 1;
  event.kind = "mode_changed";
  recorder_->on_event(state, event);
  EXPECT_TRUE(clock_.run_until([&] { return durable_next_seq_ == 100 && durable_next_event_seq_ == 2; }, 3s));
  EXPECT_EQ(rows("SELECT first_seq, last_seq, cause FROM gap"), Rows{"10|14|invalid"});
  EXPECT_EQ(rows("SELECT first_event_seq, last_event_seq, cause FROM event_gap"), Rows{"0|0|invalid"});
  EXPECT_EQ(number("SELECT count(*) FROM sample"), 95);
  EXPECT_TRUE(missing_.empty());
  EXPECT_EQ(recorder_->counters().batches_malformed, 2u);
}

}  // namespace
}  // namespace server
