// Commands beyond what a robot can acknowledge wait; an answer that never comes is an unknown end, settled when it is
// known.
#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

class UnansweredTest : public LinkTest {
 protected:
  static protocol::Command ping() {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_ping_tag;
    return command;
  }
  void accept(TestRobot& robot, std::size_t which) {
    robot.acknowledge(robot.commands().at(which), rheonaut_COMMAND_RESULT_ACCEPTED);
    clock.settle();
  }
  // Sent, and its validity passes without a word about it.
  station::CommandId unanswered(const protocol::Command& command) {
    const std::size_t before = results.size();
    submit(command, 500ms);
    EXPECT_TRUE(clock.run_until([&] { return results.size() > before; }, 3s));
    EXPECT_EQ(results.back()->state, station::CommandState::unknown);
    return results.back()->id;
  }
  // A sample that was made so long ago.
  void show_duty(TestRobot& robot, float duty, microseconds age = {}, protocol::Mode mode = rheonaut_MODE_MANUAL) {
    const auto made_us = robot.robot_now_us() - static_cast<std::uint64_t>(age.count());
    auto frame = TestRobot::samples_frame(next_seq_++, 1, made_us, 0);
    frame.body.telemetry.duty[0] = duty;
    frame.body.telemetry.mode = mode;
    robot.send(frame);
    clock.settle();
  }
  void say_event(TestRobot& robot, station::CommandId id, microseconds age = {}) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_event_tag;
    frame.body.event.kind = rheonaut_EVENT_KIND_SETPOINT_CHANGED;
    frame.body.event.cause = rheonaut_EVENT_CAUSE_COMMAND;
    frame.body.event.event_robot_time_us = robot.robot_now_us() - static_cast<std::uint64_t>(age.count());
    frame.body.event.command_id = id;
    robot.send(frame);
    clock.settle();
  }

 private:
  std::uint64_t next_seq_ = 0;
};

TEST_F(UnansweredTest, NoMoreAreOnTheirWayThanTheRobotCanAcknowledge) {
  auto* robot = connect();
  for (int i = 0; i < 14; ++i) submit(ping());
  clock.run_for(100ms);
  EXPECT_EQ(robot->commands().size(), link::CommandWindow::kMost);
  for (std::size_t i = 0; i < 14; ++i) {
    accept(*robot, i);
    EXPECT_EQ(robot->commands().size(), std::min<std::size_t>(i + 1 + link::CommandWindow::kMost, 14));
  }
  ASSERT_EQ(results.size(), 14u);
  for (const auto& result : results) EXPECT_EQ(result->state, station::CommandState::acknowledged);
}

TEST_F(UnansweredTest, AStopWaitsForNoAnswer) {
  auto* robot = connect();
  for (int i = 0; i < 14; ++i) submit(ping());
  clock.run_for(100ms);
  stop_robot();
  clock.settle();
  ASSERT_EQ(robot->commands().size(), link::CommandWindow::kMost + 1);
  EXPECT_EQ(robot->commands().back().which_action, pb_size_t{rheonaut_Command_emergency_stop_tag});
}

TEST_F(UnansweredTest, WhatWaitsForTheAnswersOfOthersKeepsItsValidity) {
  auto* robot = connect();
  for (int i = 0; i < 6; ++i) submit(ping(), 5s);
  submit(ping(), 300ms);
  clock.run_for(400ms);
  ASSERT_EQ(results.size(), 1u);
  EXPECT_EQ(results[0]->state, station::CommandState::expired);
  EXPECT_EQ(results[0]->reason, "not_sent_in_time");
  accept(*robot, 0);
  EXPECT_EQ(robot->commands().size(), 6u) << "it is not sent late";
}

TEST_F(UnansweredTest, AnAnswerThatNeverComesHoldsItsPlaceNoLongerThanItMayCome) {
  auto* robot = connect();
  for (int i = 0; i < 6; ++i) submit(ping(), 500ms);
  submit(ping(), 5s);
  clock.run_for(1'400ms);
  EXPECT_EQ(robot->commands().size(), 6u);
  clock.run_for(400ms);
  EXPECT_EQ(robot->commands().size(), 7u);
}

TEST_F(UnansweredTest, ALateAnswerSettlesIt) {
  auto* robot = connect();
  const station::CommandId id = unanswered(ping());
  accept(*robot, 0);
  EXPECT_EQ(latest(id).state, station::CommandState::acknowledged);
  EXPECT_EQ(latest(id).reason, "");
}

TEST_F(UnansweredTest, AnEventThatNamesItSettlesIt) {
  auto* robot = connect();
  const station::CommandId id = unanswered(set_setpoint(0.1F));
  say_event(*robot, id);
  EXPECT_EQ(latest(id).state, station::CommandState::acknowledged);
  EXPECT_EQ(latest(id).reason, "named_by_event");
  EXPECT_EQ(latest(id).effect_at_robot_us, robot->robot_now_us());
}

TEST_F(UnansweredTest, AnEventWhoseAnswerWasDroppedSettlesItAtOnce) {
  auto* robot = connect();
  submit(set_setpoint(0.1F));
  clock.settle();
  say_event(*robot, robot->commands().at(0).command_id);
  ASSERT_EQ(results.size(), 1u);
  EXPECT_EQ(results[0]->state, station::CommandState::acknowledged);
}

TEST_F(UnansweredTest, SamplesThatNothingElseExplainsSettleIt) {
  auto* robot = connect();
  show_duty(*robot, 0);
  const station::CommandId later = unanswered(set_duty(0.3F));
  show_duty(*robot, 0.3F, 400ms);
  EXPECT_EQ(latest(later).state, station::CommandState::verified);
  EXPECT_EQ(latest(later).reason, "no_answer");

  submit(set_duty(0.4F), 500ms);
  clock.run_for(100ms);
  show_duty(*robot, 0.4F);
  ASSERT_TRUE(clock.run_until([&] { return results.size() == 2; }, 3s));
  EXPECT_EQ(results[1]->state, station::CommandState::verified) << "they came before its answer was given up";
  EXPECT_EQ(results[1]->reason, "no_answer");
}

TEST_F(UnansweredTest, SamplesThatSomethingElseExplainsDoNot) {
  auto* robot = connect();
  show_duty(*robot, 0.2F);
  const station::CommandId shown_before = unanswered(set_duty(0.2F));
  const station::CommandId rest = unanswered(set_duty(0));
  const station::CommandId first = unanswered(set_duty(0.3F)), second = unanswered(set_duty(0.3F));
  for (const float duty : {0.2F, 0.0F, 0.3F}) show_duty(*robot, duty);
  for (const station::CommandId id : {shown_before, rest, first, second}) {
    EXPECT_EQ(latest(id).state, station::CommandState::unknown);
  }
}

TEST_F(UnansweredTest, SamplesOfALaterTimeOrOfAnotherModeProveNothing) {
  auto* robot = connect();
  show_duty(*robot, 0);
  const station::CommandId id = unanswered(set_duty(0.3F));
  show_duty(*robot, 0.3F, 400ms, rheonaut_MODE_AUTO);
  clock.run_for(1s);
  show_duty(*robot, 0.3F, 100ms);
  clock.run_for(20s);
  show_duty(*robot, 0.3F);
  EXPECT_EQ(latest(id).state, station::CommandState::unknown);
}

TEST_F(UnansweredTest, SamplesThatAnotherCommandExplainsProveNothing) {
  auto* robot = connect();
  show_duty(*robot, 0);
  submit(set_duty(0.3F), 500ms);
  clock.run_for(10ms);
  auto with_lease = set_duty(0.3F);
  with_lease.action.set_duty.lease_ms = 500;
  submit(with_lease, 500ms);
  clock.run_for(10ms);
  show_duty(*robot, 0.3F);
  ASSERT_TRUE(clock.run_until([&] { return results.size() == 2; }, 3s));
  for (const auto& result : results) EXPECT_EQ(result->state, station::CommandState::unknown);
}

TEST_F(UnansweredTest, WhatTookEffectBeforeTheLinkWasLostIsNotMissedInLiveSamplesAfterIt) {
  auto* robot = connect();
  submit(set_setpoint(0.1F));
  clock.settle();
  const station::CommandId id = robot->commands().at(0).command_id;
  robot->link.cut();
  clock.run_for(2s);
  robot = connect();
  say_event(*robot, id, 2s);
  show_duty(*robot, 0);
  clock.run_for(1s);
  show_duty(*robot, 0);
  EXPECT_EQ(latest(id).state, station::CommandState::acknowledged) << latest(id).reason;
}

TEST_F(UnansweredTest, OneThatAnEventNamesHoldsNoPlace) {
  auto* robot = connect();
  for (int i = 0; i < 6; ++i) submit(ping(), 10s);
  clock.settle();
  submit(ping(), 1s);
  clock.settle();
  ASSERT_EQ(robot->commands().size(), 6u);
  say_event(*robot, robot->commands().at(0).command_id);
  EXPECT_EQ(robot->commands().size(), 7u);
}

TEST_F(UnansweredTest, ALostLinkLeavesTheEndUnknownUntilTheRobotIsBack) {
  auto* robot = connect();
  submit(set_setpoint(0.1F));
  clock.settle();
  const station::CommandId id = robot->commands().at(0).command_id;
  robot->link.cut();
  clock.settle();
  EXPECT_EQ(latest(id).state, station::CommandState::unknown);
  EXPECT_EQ(latest(id).reason, "link_lost");
  robot = connect();
  say_event(*robot, id);
  EXPECT_EQ(latest(id).state, station::CommandState::acknowledged);
}

}  // namespace
}  // namespace server
