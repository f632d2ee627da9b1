// The limits of commands that wait on the robot for their time: steps between them, and the fluid.
#include <gmock/gmock.h>

#include "server/link/robot_outbox.hpp"
#include "tests/server/link/timed_fixture.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;

// Steps of 0.25 m, in auto at 0; in water a duty of 0.5 at most, in oil 10 s at power.
class TimedLimitsTest : public TimedTest {
 protected:
  TimedLimitsTest() : TimedTest{envelope()} {
    EXPECT_TRUE(station.set_fluid("r1", "non_newtonian", {"a", "", 0}));
    show_setpoint(0);
  }
  static config::Envelope envelope() {
    config::CommandLimits limits, water, oil, honey;
    limits.setpoint_step_m = water.setpoint_step_m = 0.25;
    water.duty_max = 0.5;
    oil.power_s = 10;
    honey.setpoint_max_m = 0.1;
    return config::Envelope{limits, {{"water", water}, {"oil", oil}, {"honey", honey}}};
  }
  void show_setpoint(float setpoint_m) {
    auto frame = TestRobot::samples_frame(next_seq_++, 1, robot->robot_now_us(), 0);
    frame.body.telemetry.mode = rheonaut_MODE_AUTO;
    frame.body.telemetry.has_setpoint_m = true;
    frame.body.telemetry.setpoint_m = setpoint_m;
    robot->send(frame);
    clock.settle();
  }
  static protocol::Command at_power(std::uint32_t lasts_s) {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_set_duty_schedule_tag;
    auto& schedule = command.action.set_duty_schedule;
    schedule.tick_count = schedule.duty_count = 2;
    schedule.tick[1] = lasts_s * 100;
    schedule.duty[0] = 1;
    return command;
  }
  void show_a_second_at_power(std::uint64_t from_us) {
    for (std::uint64_t shown = 0; shown < 100; shown += 5, next_seq_ += 5) {
      auto frame = TestRobot::samples_frame(next_seq_, 5, from_us + shown * 10'000, 0);
      for (float& duty : frame.body.telemetry.duty) duty = 1;
      robot->send(frame);
      clock.settle();
    }
  }
  void send_event(protocol::EventKind kind) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_event_tag;
    frame.body.event.kind = kind;
    frame.body.event.event_robot_time_us = robot->robot_now_us();
    robot->send(frame);
    clock.settle();
  }
  void show_position(float position_m) {  // in manual
    auto frame = TestRobot::samples_frame(next_seq_++, 1, robot->robot_now_us(), 0);
    frame.body.telemetry.position_m[0] = position_m;
    robot->send(frame);
    clock.settle();
  }
  station::CommandRequest now(protocol::Command command, microseconds time_to_live = 1s) const {
    station::CommandRequest request = request_of(command, time_to_live);
    request.actor = "a";
    return request;
  }
  // What speaks against it; empty when it is sent.
  std::string refusal(station::CommandRequest request) {
    const std::size_t before = results.size();
    submit(std::move(request));
    clock.settle();
    return results.size() == before ? "" : results.back().error().reason + ": " + results.back().error().detail;
  }

 private:
  std::uint64_t next_seq_ = 0;
};

TEST_F(TimedLimitsTest, ASetpointNowIsNotMoreThanAStepFromOneThatWaits) {
  admit(timed(set_setpoint(0.25F), in_ms(5000), "a"));
  EXPECT_THAT(refusal(now(set_setpoint(-0.25F))), HasSubstr("step_too_large"));
  EXPECT_EQ(refusal(now(set_setpoint(0))), "");
}

TEST_F(TimedLimitsTest, AStaircaseIsAdmittedStepByStep) {
  admit(timed(set_setpoint(0.25F), in_ms(1000), "a"));
  admit(timed(set_setpoint(0.5F), in_ms(2000), "a"));
  EXPECT_EQ(refusal(timed(set_setpoint(0.75F), in_ms(3000), "a")), "");
  EXPECT_THAT(refusal(timed(set_setpoint(1), in_ms(4000), "a")), HasSubstr("from the setpoint 0.500 that waits"))
      << "the step before it is not acknowledged";
}

TEST_F(TimedLimitsTest, OneOnItsWayCountsUntilTelemetryShowsWhatIsInForce) {
  clock.run_for(20ms);
  EXPECT_EQ(refusal(now(set_setpoint(0.25F), 8s)), "");
  EXPECT_THAT(refusal(now(set_setpoint(-0.25F))), HasSubstr("from the setpoint 0.250 on its way"));
  accept_last();
  results.clear();
  EXPECT_THAT(refusal(now(set_setpoint(-0.25F))), HasSubstr("step_too_large")) << "acknowledged, and not seen yet";
  clock.run_for(50ms);
  show_setpoint(0.25F);
  EXPECT_THAT(refusal(now(set_setpoint(-0.25F))), HasSubstr("from the setpoint 0.250; a step is"));
  EXPECT_EQ(refusal(now(set_setpoint(0))), "");
}

TEST_F(TimedLimitsTest, OneWithoutAnAnswerCountsUntilTelemetryComesFromAfterItsTimeToLive) {
  EXPECT_EQ(refusal(now(set_setpoint(0.25F), 500ms)), "");
  ASSERT_TRUE(clock.run_until([&] { return !results.empty(); }, 3s));
  EXPECT_EQ(results[0]->state, station::CommandState::unknown);
  EXPECT_THAT(refusal(now(set_setpoint(-0.25F))), HasSubstr("from the setpoint 0.250 on its way"));
  show_setpoint(0);
  EXPECT_EQ(refusal(now(set_setpoint(-0.25F))), "");
}

TEST_F(TimedLimitsTest, OfAFormerHolderHindersNobody) {
  admit(timed(set_setpoint(0.25F), in_ms(7000), "a"));
  clock.run_for(3100ms);
  station::CommandRequest next = now(set_setpoint(-0.25F));
  next.actor = "b";
  EXPECT_EQ(refusal(next), "");
  EXPECT_EQ(drops(), 1U);
}

TEST_F(TimedLimitsTest, ItIsDroppedWhenTheLimitsOfTheFluidBecomeNarrower) {
  const auto sent = admit(timed(set_duty(0.8F), in_ms(5000), "a"));
  ASSERT_TRUE(station.set_fluid("r1", "water", {"a", "", 0}));
  clock.settle();
  EXPECT_EQ(drops(), 1U);
  robot->acknowledge(sent, rheonaut_COMMAND_RESULT_EXPIRED);
  accept_last();
  EXPECT_EQ(latest(sent.command_id).state, station::CommandState::expired);
  EXPECT_EQ(latest(sent.command_id).reason, "limits_changed");

  admit(timed(set_duty(0.5F), in_ms(3000), "a"));
  ASSERT_TRUE(station.set_fluid("r1", "non_newtonian", {"a", "", 0}));
  clock.settle();
  EXPECT_EQ(drops(), 1U) << "the limits have become wider";
  ASSERT_TRUE(station.set_fluid("r1", "", {"a", "", 0}));
  clock.settle();
  EXPECT_EQ(drops(), 1U) << "the strictest would accept it";
}

// SAFETY: a motion does not outlive the limits that allowed it.
TEST_F(TimedLimitsTest, AMotionBeyondTheLimitsOfAnotherFluidEnds) {
  show_setpoint(0.25F);
  ASSERT_TRUE(station.set_fluid("r1", "water", {"a", "", 0}));
  clock.settle();
  EXPECT_TRUE(robot->commands().empty()) << "0.25 m is within those of water";
  ASSERT_TRUE(station.set_fluid("r1", "honey", {"a", "", 0}));
  clock.settle();
  ASSERT_FALSE(robot->commands().empty());
  EXPECT_EQ(robot->commands().back().action.set_mode.mode, rheonaut_MODE_MANUAL);
  EXPECT_EQ(latest_of_kind("set_mode").actor, "station:limits");
}

TEST_F(TimedLimitsTest, WhereItsEndCannotBeSentTheFluidStays) {
  show_setpoint(0.25F);
  while (refusal(now(ping(), 9s)).empty()) {
  }
  const auto named = station.set_fluid("r1", "honey", {"a", "", 0});
  ASSERT_FALSE(named);
  EXPECT_EQ(named.error().reason, "queue_full");
  EXPECT_EQ(station.find("r1")->fluid, "non_newtonian");
}

TEST_F(TimedLimitsTest, WhatTheLinkHasNotTakenIsNotSentWhenTheLimitsBecomeNarrower) {
  fill_window();
  submit(now(set_duty(0.8F), 9s));
  clock.settle();
  ASSERT_TRUE(station.set_fluid("r1", "water", {"a", "", 0}));
  clock.settle();
  EXPECT_EQ(latest_of_kind("set_duty").state, station::CommandState::superseded);
  EXPECT_EQ(latest_of_kind("set_duty").reason, "limits_changed");
  submit(now(set_duty(0.5F), 9s));
  ASSERT_TRUE(station.set_fluid("r1", "non_newtonian", {"a", "", 0}));
  answer_all();
  EXPECT_EQ(robot->commands().back().action.set_duty.duty, 0.5F) << "the limits have become wider";
}

TEST_F(TimedLimitsTest, ItIsDroppedLaterWhenTheLinkWasFullAndNothingIsRenewedBefore) {
  admit(timed(set_duty(0.8F), in_ms(7000), "a"));
  for (std::size_t i = 0; i < link::CommandWindow::kMost + link::RobotOutbox::kMaxQueuedCommands; ++i) {
    submit(ping(), 5s);
    clock.settle();
  }
  ASSERT_TRUE(station.set_fluid("r1", "water", {"a", "", 0}));
  protocol::Command renewal = rheonaut_Command_init_zero;
  renewal.which_action = rheonaut_Command_renew_lease_tag;
  EXPECT_THAT(refusal(now(renewal)), HasSubstr("queue_full"));
  for (std::size_t i = 1; i < robot->commands().size(); ++i) {
    robot->acknowledge(robot->commands()[i], rheonaut_COMMAND_RESULT_ACCEPTED);
    clock.settle();
    if (i == 5) submit(now(renewal));
  }
  const auto sent = kinds();
  const auto drop = std::ranges::find(sent, std::string{"drop_timed"});
  const auto renewed = std::ranges::find(sent, std::string{"renew_lease"});
  ASSERT_NE(renewed, sent.end());
  EXPECT_LT(drop - sent.begin(), renewed - sent.begin());
  EXPECT_EQ(drops(), 1U);
}

// The robot refuses one by itself; whatever was a step from it is more than that from what is in force.
TEST_F(TimedLimitsTest, ItIsDroppedWhenTheSetpointBeforeItWas) {
  const auto first = admit(timed(set_setpoint(0.25F), in_ms(1000), "a"));
  const auto second = admit(timed(set_setpoint(0.5F), in_ms(2000), "a"));
  clock.run_for(1s);
  robot->acknowledge(first, rheonaut_COMMAND_RESULT_REJECTED, 0, rheonaut_REJECT_REASON_UNCERTAIN);
  show_setpoint(0);
  EXPECT_EQ(drops(), 1U);
  robot->acknowledge(second, rheonaut_COMMAND_RESULT_EXPIRED);
  accept_last();
  EXPECT_EQ(latest(second.command_id).reason, "step_before_dropped");
}

TEST_F(TimedLimitsTest, ADropThatFoundNoRoomIsSentAsSoonAsThereIsSome) {
  const auto first = admit(timed(set_setpoint(0.25F), in_ms(1000), "a"));
  admit(timed(set_setpoint(0.5F), in_ms(2000), "a"));
  for (std::size_t i = 0; i < link::CommandWindow::kMost + link::RobotOutbox::kMaxQueuedCommands; ++i) {
    submit(ping(), 9s);
    clock.settle();
  }
  clock.run_for(1s);
  robot->acknowledge(first, rheonaut_COMMAND_RESULT_REJECTED, 0, rheonaut_REJECT_REASON_UNCERTAIN);
  show_setpoint(0);
  answer_all();
  EXPECT_EQ(drops(), 0U) << "the queue was full";
  show_setpoint(0);
  EXPECT_EQ(drops(), 1U);
}

TEST_F(TimedLimitsTest, WhatIsToBeDroppedCountsWhereItMayHaveActedBefore) {
  admit(timed(set_setpoint(0.25F), in_ms(500), "a"));
  admit(timed(set_setpoint(0), in_ms(3000), "a"));
  clock.run_for(510ms);
  control(station::ControlAction::force, "b");
  ASSERT_EQ(drops(), 1U);
  station::CommandRequest next = now(set_setpoint(-0.25F));
  next.actor = "b";
  EXPECT_THAT(refusal(next), HasSubstr("from the setpoint 0.250 that waits")) << "its time has come";
  show_setpoint(0);
  EXPECT_EQ(refusal(next), "") << "telemetry of after that time shows that it has not acted";
}

TEST_F(TimedLimitsTest, WhatIsToBeDroppedCountsWhileTheLeaseMayBeExtended) {
  admit(timed(set_setpoint(0.25F), in_ms(3000), "a"));
  protocol::Command renewal = rheonaut_Command_init_zero;
  renewal.which_action = rheonaut_Command_renew_lease_tag;
  submit(now(renewal));
  clock.settle();
  control(station::ControlAction::force, "b");
  station::CommandRequest next = now(set_setpoint(-0.25F));
  next.actor = "b";
  EXPECT_THAT(refusal(next), HasSubstr("step_too_large"));
  robot->acknowledge(robot->commands()[1], rheonaut_COMMAND_RESULT_ACCEPTED);
  clock.settle();
  EXPECT_EQ(refusal(next), "");
}

TEST_F(TimedLimitsTest, AfterAReconnectNoSetpointIsJudgedByWhatWasInForceBefore) {
  admit(timed(set_setpoint(0.25F), in_ms(100), "a"));
  robot->link.cut();
  clock.run_for(200ms);
  come_back();
  EXPECT_THAT(refusal(now(set_setpoint(-0.25F))), HasSubstr("not known before its next telemetry"));
  show_setpoint(0.25F);
  EXPECT_THAT(refusal(now(set_setpoint(-0.25F))), HasSubstr("from the setpoint 0.250"));
  EXPECT_EQ(refusal(now(set_setpoint(0))), "");
}

TEST_F(TimedLimitsTest, OneThatANewerOneTakesBackDoesNotHinderIt) {
  fill_window();
  EXPECT_EQ(refusal(now(set_setpoint(0.25F), 9s)), "");
  submit(now(set_setpoint(-0.25F), 9s));
  answer_all();
  EXPECT_EQ(robot->commands().back().action.set_setpoint.setpoint_m, -0.25F);
  EXPECT_EQ(robot->commands().size(), link::CommandWindow::kMost + 1U);
}

// Driven in manual until the time of set_mode auto comes.
TEST_F(TimedLimitsTest, ItIsDroppedWhenTheRobotHasBeenDrivenMoreThanAStepAway) {
  show_position(0);
  protocol::Command automatic = rheonaut_Command_init_zero;
  automatic.which_action = rheonaut_Command_set_mode_tag;
  automatic.action.set_mode.mode = rheonaut_MODE_AUTO;
  automatic.action.set_mode.has_setpoint_m = true;
  automatic.action.set_mode.setpoint_m = 0.2F;
  const auto first = admit(timed(automatic, in_ms(5000), "a"));
  admit(timed(set_setpoint(0.4F), in_ms(6000), "a"));
  clock.run_for(1s);
  show_position(-0.05F);
  EXPECT_EQ(drops(), 0U) << "just the limit; and only the first counts from the position";
  show_position(-0.06F);
  EXPECT_EQ(drops(), 1U);
  robot->acknowledge(first, rheonaut_COMMAND_RESULT_EXPIRED);
  accept_last();
  EXPECT_EQ(latest(first.command_id).state, station::CommandState::expired);
  EXPECT_EQ(latest(first.command_id).reason, "step_too_large");
  show_position(-0.07F);
  EXPECT_EQ(drops(), 1U) << "nothing waits any more";
}

TEST_F(TimedLimitsTest, AScheduleThatRunsCountsForTheTimeAtPowerUntilItEnds) {
  ASSERT_TRUE(station.set_fluid("r1", "oil", {"a", "", 0}));
  const auto next = [this] { return timed(at_power(2), in_ms(5000), "a"); };
  EXPECT_EQ(refusal(now(at_power(9))), "");
  EXPECT_THAT(refusal(next()), HasSubstr("asks for 9.0 s more")) << "it may run";
  accept_last();
  EXPECT_THAT(refusal(next()), HasSubstr("asks for 9.0 s more"));
  clock.run_for(20ms);
  send_event(rheonaut_EVENT_KIND_SETPOINT_CHANGED);
  EXPECT_THAT(refusal(next()), HasSubstr("too_long_at_power"));
  send_event(rheonaut_EVENT_KIND_LEASE_LAPSED);
  EXPECT_EQ(refusal(next()), "");
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_REJECTED, 0, rheonaut_REJECT_REASON_BUSY);
  clock.settle();

  EXPECT_EQ(refusal(now(at_power(9))), "");
  accept_last();
  clock.run_for(20ms);
  EXPECT_EQ(refusal(now(set_duty(0))), "");
  accept_last();
  EXPECT_EQ(refusal(next()), "") << "a command for now has ended it";
}

TEST_F(TimedLimitsTest, AScheduleEndsWithWhatTheRobotReadsTogetherWithItAndWhereThePositionIsUncertain) {
  ASSERT_TRUE(station.set_fluid("r1", "oil", {"a", "", 0}));
  const auto next = [this] { return timed(at_power(2), in_ms(5000), "a"); };
  EXPECT_EQ(refusal(now(at_power(9))), "");
  EXPECT_EQ(refusal(now(set_duty(0))), "");
  const auto sent = robot->commands();
  robot->acknowledge(sent[sent.size() - 2], rheonaut_COMMAND_RESULT_ACCEPTED);
  robot->acknowledge(sent[sent.size() - 1], rheonaut_COMMAND_RESULT_ACCEPTED);
  clock.settle();
  EXPECT_EQ(refusal(next()), "");
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_REJECTED, 0, rheonaut_REJECT_REASON_BUSY);
  clock.settle();

  EXPECT_EQ(refusal(now(at_power(9))), "");
  accept_last();
  clock.run_for(20ms);
  EXPECT_THAT(refusal(next()), HasSubstr("too_long_at_power"));
  send_event(rheonaut_EVENT_KIND_POSITION_UNCERTAIN);
  EXPECT_EQ(refusal(next()), "");
}

// Whether it has run is not known, and nothing may ever say so: a command after it ends it.
TEST_F(TimedLimitsTest, AScheduleWithoutAnAnswerCountsUntilALaterDutyIsAccepted) {
  ASSERT_TRUE(station.set_fluid("r1", "oil", {"a", "", 0}));
  const auto next = [this] { return timed(at_power(2), in_ms(5000), "a"); };
  EXPECT_EQ(refusal(now(at_power(9))), "");
  const station::CommandId id = robot->commands().back().command_id;
  clock.run_until([&] { return latest(id).state == station::CommandState::unknown; }, 10s);
  EXPECT_EQ(latest(id).state, station::CommandState::unknown);
  EXPECT_THAT(refusal(next()), HasSubstr("too_long_at_power"));
  EXPECT_EQ(refusal(now(set_duty(0))), "");
  EXPECT_THAT(refusal(next()), HasSubstr("too_long_at_power")) << "not before the answer";
  accept_last();
  EXPECT_EQ(refusal(next()), "");
}

TEST_F(TimedLimitsTest, AScheduleThatHasBegunAtItsTimeCountsByWhatIsLeft) {
  ASSERT_TRUE(station.set_fluid("r1", "oil", {"a", "", 0}));
  const auto sent = admit(timed(at_power(9), in_ms(100), "a"));
  EXPECT_THAT(refusal(timed(at_power(2), in_ms(5000), "a")), HasSubstr("asks for 9.0 s more"));
  clock.run_for(1100ms);
  show_a_second_at_power(sent.execute_at_robot_us);
  EXPECT_EQ(latest(sent.command_id).state, station::CommandState::verified);
  EXPECT_THAT(refusal(timed(at_power(2), in_ms(5000), "a")), HasSubstr("run for 1.0 s, and what runs or waits for its "
                                                                       "time asks for 8.0 s more"));
  EXPECT_EQ(refusal(timed(at_power(1), in_ms(5000), "a")), "");
}

TEST_F(TimedLimitsTest, ADroppedScheduleCountsNoMore) {
  ASSERT_TRUE(station.set_fluid("r1", "oil", {"a", "", 0}));
  const auto sent = admit(timed(at_power(9), in_ms(5000), "a"));
  EXPECT_THAT(refusal(now(at_power(2))), HasSubstr("too_long_at_power"));
  robot->acknowledge(sent, rheonaut_COMMAND_RESULT_EXPIRED);
  clock.settle();
  EXPECT_EQ(refusal(now(at_power(2))), "");
}

TEST_F(TimedLimitsTest, NothingIsDroppedAgainThatTheRobotDroppedTogether) {
  const auto first = admit(timed(set_setpoint(0.25F), in_ms(1000), "a"));
  const auto second = admit(timed(set_setpoint(0.5F), in_ms(2000), "a"));
  for (const auto& command : {first, second}) robot->acknowledge(command, rheonaut_COMMAND_RESULT_EXPIRED);
  show_setpoint(0);
  EXPECT_EQ(drops(), 0U);
}

}  // namespace
}  // namespace server
