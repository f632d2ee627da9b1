// Commands that wait on the robot for their time: their ends, and that they outlive nobody's control.
#include "server/link/robot_outbox.hpp"
#include "tests/server/link/timed_fixture.hpp"

namespace server {
namespace {

using TimedControlTest = TimedTest;

TEST_F(TimedControlTest, IsLookedForFromItsTimeOn) {
  const std::uint64_t at_us = in_ms(6000);
  admit(timed(set_duty(0.25F), at_us, "a"));
  clock.run_for(5900ms);
  EXPECT_TRUE(results.empty()) << "longer than what runs at once may take";
  auto frame = TestRobot::samples_frame(0, 1, at_us, 0);
  frame.body.telemetry.duty[0] = 0.25F;
  robot->send(frame);
  clock.settle();
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0]->state, station::CommandState::verified);
}

TEST_F(TimedControlTest, ExcusesNoStopThatTheMotorRunsOnAfter) {
  admit(timed(set_duty(0.25F), in_ms(5000), "a"));
  stop_robot(8s);
  clock.settle();
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED, 7);
  clock.settle();
  show_that_the_motor_runs_on();
  EXPECT_EQ(latest_of_kind("emergency_stop").state, station::CommandState::failed)
      << latest_of_kind("emergency_stop").reason;
}

// The robot puts a stop's answer ahead of all others, also of a command that it has taken in before.
TEST_F(TimedControlTest, ExcusesNoStopWhoseAnswerPassesItsOwn) {
  const auto waiting = send_out(timed(set_duty(0.25F), in_ms(300), "a"));
  stop_robot(8s);
  clock.settle();
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED, 7);
  accept_for_its_time(waiting);
  robot->acknowledge(waiting, rheonaut_COMMAND_RESULT_REJECTED, 7, rheonaut_REJECT_REASON_LATCHED);
  clock.settle();
  EXPECT_EQ(latest_of_kind("set_duty").state, station::CommandState::rejected);
  show_that_the_motor_runs_on();
  EXPECT_EQ(latest_of_kind("emergency_stop").state, station::CommandState::failed)
      << latest_of_kind("emergency_stop").reason;
}

TEST_F(TimedControlTest, AStopIsExcusedByAClearOfItsLatch) {
  stop_robot(8s);
  clock.settle();
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED, 7);
  clock.settle();
  submit(clear_emergency(7));
  clock.settle();
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED, 0);
  clock.settle();
  show_that_the_motor_runs_on();
  EXPECT_EQ(latest_of_kind("emergency_stop").state, station::CommandState::superseded)
      << latest_of_kind("emergency_stop").reason;
}

TEST_F(TimedControlTest, EndsAsTheRobotSaysWhenItDropsIt) {
  const auto first = admit(timed(set_duty(0.25F), in_ms(3000), "a"));
  const auto second = admit(timed(set_duty(0.5F), in_ms(4000), "a"));
  robot->acknowledge(first, rheonaut_COMMAND_RESULT_EXPIRED);
  robot->acknowledge(second, rheonaut_COMMAND_RESULT_REJECTED, 0, rheonaut_REJECT_REASON_LATCHED);
  clock.settle();
  ASSERT_EQ(results.size(), 2U);
  EXPECT_EQ(results[0]->state, station::CommandState::expired);
  EXPECT_EQ(results[1]->state, station::CommandState::rejected);
  EXPECT_EQ(results[1]->reason, "latched");
}

TEST_F(TimedControlTest, IsRefusedForATimeAfterTheLifeOfTheCommand) {
  submit(timed(set_duty(0.25F), in_ms(8100), "a"));
  clock.settle();
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0].error().reason, "out_of_range");
  EXPECT_TRUE(robot->commands().empty());
  EXPECT_TRUE(station.find("r1")->control.holder.empty()) << "what is refused takes no control";
}

TEST_F(TimedControlTest, AScheduleThatIsReplacedBeforeItsFirstMotionIsSuperseded) {
  robot->send_samples(0, 5, in_ms(0), 0);
  const std::uint64_t at_us = in_ms(500);
  admit(timed(moves_after_a_second(), at_us, "a"));
  admit(timed(set_duty(0), at_us + 700'000, "a"));
  for (std::uint64_t seq = 5; seq < 250; seq += 5) robot->send_samples(seq, 5, at_us + seq * 10'000, 0);
  clock.settle();
  EXPECT_EQ(latest_of_kind("set_duty").state, station::CommandState::verified);
  EXPECT_EQ(latest_of_kind("set_duty_schedule").state, station::CommandState::superseded)
      << latest_of_kind("set_duty_schedule").reason;
}

TEST_F(TimedControlTest, AScheduleThatShouldHaveMovedBeforeTheNextCommandFails) {
  robot->send_samples(0, 5, in_ms(0), 0);
  const std::uint64_t at_us = in_ms(500);
  admit(timed(moves_after_a_second(), at_us, "a"));
  admit(timed(set_duty(0), at_us + 1'600'000, "a"));
  for (std::uint64_t seq = 5; seq < 250; seq += 5) robot->send_samples(seq, 5, at_us + seq * 10'000, 0);
  clock.settle();
  EXPECT_EQ(latest_of_kind("set_duty_schedule").state, station::CommandState::failed)
      << latest_of_kind("set_duty_schedule").reason;
}

TEST_F(TimedControlTest, AScheduleIsSeenByItsFirstMotion) {
  const std::uint64_t at_us = in_ms(500);
  admit(timed(moves_after_a_second(), at_us, "a"));
  robot->send_samples(0, 5, at_us, 0);
  robot->send_samples(5, 5, at_us + 600'000, 0);
  clock.settle();
  EXPECT_TRUE(results.empty()) << "it begins with a second of 0";
  auto frame = TestRobot::samples_frame(10, 1, at_us + 1'000'000, 0);
  frame.body.telemetry.duty[0] = 0.3F;
  robot->send(frame);
  clock.settle();
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0]->state, station::CommandState::verified);
}

// SAFETY: each way in which control ends.
TEST_F(TimedControlTest, IsDroppedWhenControlIsReleasedForcedHandedOverOrExpires) {
  admit(timed(set_duty(0.25F), in_ms(2000), "a"));
  control(station::ControlAction::release, "a");
  EXPECT_EQ(drops(), 1U);
  accept_last();

  admit(timed(set_duty(0.25F), in_ms(2000), "a"));
  control(station::ControlAction::force, "b");
  EXPECT_EQ(drops(), 2U);
  accept_last();

  admit(timed(set_duty(0.25F), in_ms(2000), "b"));
  control(station::ControlAction::request, "a");
  EXPECT_EQ(drops(), 2U) << "who asks for control changes nothing";
  control(station::ControlAction::hand_over, "b");
  EXPECT_EQ(drops(), 3U);
  accept_last();

  tasks.spawn("watch", station.watch_control());
  admit(timed(set_duty(0.25F), in_ms(7000), "a"));
  clock.run_for(2900ms);
  EXPECT_EQ(drops(), 3U);
  clock.run_for(500ms);
  EXPECT_EQ(drops(), 4U);
  EXPECT_EQ(sink.commands.back().actor, "station:control");
}

TEST_F(TimedControlTest, IsNotDroppedWhenNoneMayWaitAnyMore) {
  admit(timed(set_duty(0.25F), in_ms(500), "a"));
  clock.run_for(1s);
  control(station::ControlAction::release, "a");
  EXPECT_EQ(drops(), 0U);
}

// Nobody has noticed yet that control has run out; the next holder's first command comes all the same.
TEST_F(TimedControlTest, IsDroppedAheadOfTheNextHoldersFirstCommand) {
  admit(timed(set_duty(0.25F), in_ms(7000), "a"));
  clock.run_for(3100ms);
  station::CommandRequest next = request_of(set_duty(0.5F));
  next.actor = "b";
  submit(std::move(next));
  clock.settle();
  const auto sent = robot->commands();
  ASSERT_EQ(sent.size(), 3U);
  EXPECT_EQ(sent[1].which_action, rheonaut_Command_drop_timed_tag);
  EXPECT_EQ(sent[2].action.set_duty.duty, 0.5F);
}

// SAFETY: nobody's command passes the one that drops what waits.
TEST_F(TimedControlTest, IsDroppedBeforeAnythingElseAlsoWhenTheLinkWasFull) {
  admit(timed(set_duty(0.25F), in_ms(7000), "a"));
  for (std::size_t i = 0; i < link::CommandWindow::kMost + link::RobotOutbox::kMaxQueuedCommands; ++i) {
    submit(ping(), 8s);
    clock.settle();
  }
  control(station::ControlAction::force, "b");
  station::CommandRequest next = request_of(set_duty(0.5F), 8s);
  next.actor = "b";
  std::size_t refused = 0, answered = 1;
  const auto is_next = [](const protocol::Command& one) {
    return one.which_action == rheonaut_Command_set_duty_tag && one.action.set_duty.duty == 0.5F;
  };
  while (std::ranges::none_of(robot->commands(), is_next) && answered < 200) {
    const std::size_t before = results.size();
    if (drops() == 0 || refused < 3) submit(next);
    clock.settle();
    if (results.size() > before && !results.back() && results.back().error().reason == "queue_full") ++refused;
    if (answered < robot->commands().size()) {
      robot->acknowledge(robot->commands()[answered++], rheonaut_COMMAND_RESULT_ACCEPTED);
    }
    clock.settle();
  }
  EXPECT_GE(refused, 2U) << "with no room at all, and with room for the drop alone";
  const auto sent = robot->commands();
  const auto drop =
      std::ranges::find(sent, pb_size_t{rheonaut_Command_drop_timed_tag}, &protocol::Command::which_action);
  EXPECT_LT(drop - sent.begin(), std::ranges::find_if(sent, is_next) - sent.begin());
  EXPECT_EQ(drops(), 1U);
}

TEST_F(TimedControlTest, OfTheSameActorIsDroppedToWhenControlHadEndedInBetween) {
  admit(timed(set_duty(0.25F), in_ms(7000), "a"));
  clock.run_for(3100ms);
  control(station::ControlAction::take, "a");
  EXPECT_EQ(drops(), 1U);
}

TEST_F(TimedControlTest, IsDroppedFirstOnTheNextConnectionWhenTheLinkWasCut) {
  admit(timed(set_duty(0.25F), in_ms(7000), "a"));
  control(station::ControlAction::release, "a");
  ASSERT_EQ(drops(), 1U) << "and the link is cut before the answer";
  come_back();
  EXPECT_EQ(robot->commands()[0].which_action, rheonaut_Command_drop_timed_tag);
}

TEST_F(TimedControlTest, IsDroppedAgainWhenThatCameTooLateButNotForAFirmwareThatDoesNotKnowIt) {
  const auto submit_as_b = [this] {
    station::CommandRequest next = request_of(set_duty(0.5F));
    next.actor = "b";
    submit(std::move(next));
    clock.settle();
  };
  admit(timed(set_duty(0.25F), in_ms(7000), "a"));
  control(station::ControlAction::force, "b");
  robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_EXPIRED);
  clock.settle();
  submit_as_b();
  EXPECT_EQ(drops(), 2U);
  EXPECT_EQ(kinds().back(), std::string{"set_duty"});
  robot->acknowledge(robot->commands()[2], rheonaut_COMMAND_RESULT_REJECTED, 0, rheonaut_REJECT_REASON_MALFORMED);
  clock.settle();
  submit_as_b();
  EXPECT_EQ(drops(), 2U);
}

TEST_F(TimedControlTest, OfALostLinkEndsAsTheRobotSaysWhenItIsBack) {
  const auto sent = admit(timed(set_duty(0.25F), in_ms(7000), "a"));
  come_back();
  EXPECT_EQ(latest(sent.command_id).state, station::CommandState::unknown);
  EXPECT_EQ(latest(sent.command_id).reason, "link_lost");
  ASSERT_EQ(robot->commands().size(), 1U);
  EXPECT_EQ(robot->commands()[0].which_action, rheonaut_Command_drop_timed_tag) << "nor does it outlive the link";
  robot->acknowledge(sent, rheonaut_COMMAND_RESULT_EXPIRED);
  accept_last();
  EXPECT_EQ(latest(sent.command_id).state, station::CommandState::expired);
  EXPECT_EQ(latest(sent.command_id).reason, "link_lost");
}

// The robot came back before it noticed, and it ran before it could be dropped.
TEST_F(TimedControlTest, OfALostLinkIsVerifiedBySamplesThatNothingElseExplains) {
  const auto show_duty_at = [this](std::uint64_t seq, std::uint64_t at_us, float duty) {
    auto frame = TestRobot::samples_frame(seq, 1, at_us, 0);
    frame.body.telemetry.duty[0] = duty;
    robot->send(frame);
    clock.settle();
  };
  show_duty_at(0, in_ms(0), 0);
  const std::uint64_t at_us = in_ms(1000);
  const auto alone = admit(timed(set_duty(0.25F), at_us, "a"));
  come_back();
  clock.run_for(1s);
  show_duty_at(1, at_us, 0.25F);
  EXPECT_EQ(latest(alone.command_id).state, station::CommandState::verified);

  clock.run_for(10s);
  show_duty_at(2, in_ms(0), 0);
  const std::uint64_t next_us = in_ms(1000);
  const auto first = admit(timed(set_duty(0.25F), next_us, "a"));
  admit(timed(set_duty(0.25F), in_ms(500), "a"));
  come_back();
  clock.run_for(1s);
  show_duty_at(3, next_us, 0.25F);
  EXPECT_EQ(latest(first.command_id).state, station::CommandState::unknown)
      << "the other one may have brought it about";
}

// Its acknowledgement of a drop finds room on the robot, whatever else is on its way.
TEST_F(TimedControlTest, KeepsAPlaceOfTheAcknowledgementsUntilItsEnd) {
  std::vector<protocol::Command> waiting;
  for (int i = 0; i < 4; ++i) waiting.push_back(admit(timed(set_duty(0.25F), in_ms(5000), "a")));
  for (int i = 0; i < 6; ++i) submit(ping(), 8s);
  clock.settle();
  EXPECT_EQ(robot->commands().size(), 4U + 2U);
  robot->acknowledge(waiting[0], rheonaut_COMMAND_RESULT_EXPIRED);
  clock.settle();
  EXPECT_EQ(robot->commands().size(), 4U + 3U);
  clock.run_for(5000ms);
  EXPECT_EQ(robot->commands().size(), 4U + 3U);
  clock.run_for(500ms);
  EXPECT_EQ(robot->commands().size(), 4U + 6U) << "their time has passed, and no word came of them";
}

TEST_F(TimedControlTest, FreesItsPlaceTwoTicksAfterItsTime) {
  const std::uint64_t at_us = in_ms(500);
  for (int i = 0; i < 4; ++i) admit(timed(set_duty(0.25F), at_us, "a"));
  for (int i = 0; i < 6; ++i) submit(ping(), 8s);
  clock.settle();
  ASSERT_EQ(robot->commands().size(), 4U + 2U);
  clock.run_for(525ms);
  auto frame = TestRobot::samples_frame(0, 1, at_us, 0);
  frame.robot_time_us = at_us + 20'000;
  robot->send(frame);
  clock.settle();
  EXPECT_EQ(robot->commands().size(), 4U + 2U);
  frame.robot_time_us = at_us + 20'001;
  robot->send(frame);
  clock.settle();
  EXPECT_EQ(robot->commands().size(), 4U + 6U);
}

TEST_F(TimedControlTest, TakesTwoPlacesUntilTheRobotHasTakenItIn) {
  for (int i = 0; i < 4; ++i) submit(timed(set_duty(0.25F), in_ms(5000), "a"));
  clock.settle();
  ASSERT_EQ(robot->commands().size(), 3U);
  robot->acknowledge(robot->commands()[0], rheonaut_COMMAND_RESULT_REJECTED, 0, rheonaut_REJECT_REASON_BUSY);
  clock.settle();
  EXPECT_EQ(robot->commands().size(), 4U);
}

// SAFETY: timed or not, what waits for the link is sent for nobody who is no longer in control.
TEST_F(TimedControlTest, WhatTheLinkHasNotTakenEndsWithControlWhetherTimedOrNot) {
  fill_window();
  const auto submit_of_a = [this](const protocol::Command& command) {
    station::CommandRequest request = request_of(command, 10s);
    request.actor = "a";
    submit(std::move(request));
    clock.settle();
  };
  protocol::Command set_manual = rheonaut_Command_init_zero;
  set_manual.which_action = rheonaut_Command_set_mode_tag;
  set_manual.action.set_mode.mode = rheonaut_MODE_MANUAL;
  submit_of_a(set_duty(0.8F));
  submit_of_a(moves_after_a_second());
  submit_of_a(set_manual);
  submit(timed(set_duty(0.25F), in_ms(100), "a"));
  clock.run_for(1s);
  control(station::ControlAction::force, "b");
  for (const char* kind : {"set_duty", "set_duty_schedule"}) {
    EXPECT_EQ(latest_of_kind(kind).state, station::CommandState::superseded) << kind;
    EXPECT_EQ(latest_of_kind(kind).reason, "control_ended") << kind;
  }
  station::CommandRequest next = request_of(set_duty(0.5F), 5s);
  next.actor = "b";
  submit(std::move(next));
  clock.settle();
  answer_all();
  const auto sent = kinds();
  ASSERT_EQ(sent.size(), link::CommandWindow::kMost + 2U);
  EXPECT_EQ(sent[link::CommandWindow::kMost], std::string{"set_mode"}) << "what only ends a motion is sent";
  EXPECT_EQ(robot->commands().back().action.set_duty.duty, 0.5F);
}

TEST_F(TimedControlTest, WhatTheLinkHasNotTakenEndsWhenControlIsReleasedButNotWhenItIsTaken) {
  fill_window();
  station::CommandRequest of_nobody = request_of(moves_after_a_second(), 9s);
  of_nobody.actor = "a";
  of_nobody.takes_control = false;
  submit(of_nobody);
  clock.settle();
  control(station::ControlAction::take, "a");
  EXPECT_EQ(latest_of_kind("set_duty_schedule").state, station::CommandState::queued);
  station::CommandRequest held = request_of(set_duty(0.5F), 9s);
  held.actor = "a";
  submit(held);
  clock.settle();
  protocol::Command parameter = rheonaut_Command_init_zero;
  parameter.which_action = rheonaut_Command_set_parameter_tag;
  station::CommandRequest without_control = request_of(parameter, 9s);  // as the sender of models does it
  without_control.actor = "a";
  without_control.takes_control = false;
  submit(without_control);
  clock.settle();
  control(station::ControlAction::release, "a");
  EXPECT_EQ(latest_of_kind("set_duty").reason, "control_ended");
  EXPECT_EQ(latest_of_kind("set_parameter").state, station::CommandState::queued)
      << "it was not sent by right of control";
}

TEST_F(TimedControlTest, LeavesThoseThatTheHolderStillControls) {
  admit(timed(set_duty(0.25F), in_ms(2000), "a"));
  control(station::ControlAction::take, "a");
  station::CommandRequest more = request_of(set_duty(0.1F));
  more.actor = "a";
  submit(std::move(more));
  clock.settle();
  EXPECT_EQ(drops(), 0U);
}

}  // namespace
}  // namespace server
