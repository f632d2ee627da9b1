// The limits of commands that wait on the robot for their time: steps between them, and the time at power.
#include "tests/server/link/limits_fixture.hpp"

namespace server {
namespace {

using ::testing::HasSubstr;

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
