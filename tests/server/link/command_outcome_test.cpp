// What becomes of a command after it was sent: seen in telemetry or not, superseded, asked for again.
#include "server/station/commands/recent_commands.hpp"
#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

class CommandOutcomeTest : public LinkTest {
 protected:
  void accept(TestRobot& robot, std::size_t which) {
    robot.acknowledge(robot.commands().at(which), rheonaut_COMMAND_RESULT_ACCEPTED);
    clock.settle();
  }

  void show_duty(TestRobot& robot, float duty, std::uint64_t robot_time_us) {
    auto frame = TestRobot::samples_frame(next_seq_++, 1, robot_time_us, 0);
    frame.body.telemetry.duty[0] = duty;
    robot.send(frame);
    clock.settle();
  }
  void show_setpoint(TestRobot& robot, float setpoint_m, std::uint64_t robot_time_us) {
    auto frame = TestRobot::samples_frame(next_seq_++, 1, robot_time_us, 0);
    frame.body.telemetry.mode = rheonaut_MODE_AUTO;
    frame.body.telemetry.has_setpoint_m = true;
    frame.body.telemetry.setpoint_m = setpoint_m;
    robot.send(frame);
    clock.settle();
  }

 private:
  std::uint64_t next_seq_ = 0;
};

TEST_F(CommandOutcomeTest, IsVerifiedWhenTelemetryShowsItAfterItsEffect) {
  auto* robot = connect();
  submit(set_duty(0.3F));
  clock.settle();
  const std::uint64_t before_us = robot->robot_now_us();
  clock.run_for(10ms);
  accept(*robot, 0);
  ASSERT_EQ(results.at(0)->state, station::CommandState::acknowledged);
  EXPECT_EQ(results[0]->acknowledged_after_us, 10'000);
  show_duty(*robot, 0.3F, before_us);
  EXPECT_EQ(latest(results[0]->id).state, station::CommandState::acknowledged) << "a duty of before is no evidence";
  clock.run_for(10ms);
  show_duty(*robot, 0.3F, robot->robot_now_us());
  EXPECT_EQ(latest(results[0]->id).state, station::CommandState::verified);
  EXPECT_EQ(latest(results[0]->id).verified_after_us, 20'000);
  EXPECT_NE(latest(results[0]->id).ended_at_us, 0);
}

TEST_F(CommandOutcomeTest, FailsWhenTelemetryGoesOnWithoutShowingIt) {
  auto* robot = connect();
  submit(set_duty(0.3F));
  clock.settle();
  accept(*robot, 0);
  for (int i = 0; i < 60; ++i) {
    EXPECT_EQ(latest(results.at(0)->id).state,
              i <= 50 ? station::CommandState::acknowledged : station::CommandState::failed)
        << i;
    show_duty(*robot, 0, robot->robot_now_us());
    clock.run_for(10ms);
  }
  EXPECT_EQ(latest(results[0]->id).reason, "not_seen_in_telemetry");
}

TEST_F(CommandOutcomeTest, WithoutTelemetryItStaysAcknowledgedAndEnds) {
  auto* robot = connect();
  submit(set_duty(0.3F));
  clock.settle();
  accept(*robot, 0);
  clock.run_for(6s);
  EXPECT_EQ(latest(results.at(0)->id).state, station::CommandState::acknowledged);
  EXPECT_EQ(latest(results[0]->id).reason, "no_telemetry");
  EXPECT_NE(latest(results[0]->id).ended_at_us, 0);
  submit(set_duty(0.4F));
  clock.settle();
  accept(*robot, 1);
  robot->link.cut();
  clock.settle();
  EXPECT_EQ(latest(results.at(1)->id).reason, "link_lost");
}

TEST_F(CommandOutcomeTest, ANewerOneThatTookItsPlaceBeforeItWasSeenSupersedesIt) {
  auto* robot = connect();
  submit(set_duty(0.3F));
  clock.settle();
  accept(*robot, 0);
  submit(set_duty(0.4F));
  clock.settle();
  accept(*robot, 1);
  show_duty(*robot, 0.4F, robot->robot_now_us());
  clock.run_for(600ms);
  show_duty(*robot, 0.4F, robot->robot_now_us());
  EXPECT_EQ(latest(results.at(0)->id).state, station::CommandState::superseded);
  EXPECT_EQ(latest(results.at(1)->id).state, station::CommandState::verified);
}

TEST_F(CommandOutcomeTest, AnEmergencyOfTheRobotSupersedesWhatWasNotSeen) {
  auto* robot = connect();
  submit(set_duty(0.3F));
  clock.settle();
  accept(*robot, 0);
  robot->send_samples(0, 1, robot->robot_now_us(), 5);
  clock.settle();
  EXPECT_EQ(latest(results.at(0)->id).state, station::CommandState::superseded);
  EXPECT_EQ(latest(results[0]->id).reason, "by_an_emergency");
}

TEST_F(CommandOutcomeTest, WhoWantsToWaitsUntilItIsVerified) {
  auto* robot = connect();
  station::CommandRequest request = request_of(set_setpoint(0.1F));
  request.until_verified = true;
  submit(request);
  clock.settle();
  accept(*robot, 0);
  clock.run_for(50ms);
  EXPECT_TRUE(results.empty());
  show_setpoint(*robot, 0.1F, robot->robot_now_us());
  ASSERT_EQ(results.size(), 1u);
  EXPECT_EQ(results[0]->state, station::CommandState::verified);
}

TEST_F(CommandOutcomeTest, WhatNoSampleCanShowEndsAcknowledged) {
  auto* robot = connect();
  protocol::Command ping = rheonaut_Command_init_zero;
  ping.which_action = rheonaut_Command_ping_tag;
  station::CommandRequest request = request_of(ping);
  request.until_verified = true;
  submit(request);
  clock.settle();
  accept(*robot, 0);
  ASSERT_EQ(results.size(), 1u);
  EXPECT_EQ(results[0]->state, station::CommandState::acknowledged);
  EXPECT_NE(results[0]->ended_at_us, 0);
}

// SAFETY: of what piled up while the link took nothing, only the newest setpoint is sent.
TEST_F(CommandOutcomeTest, OfTheSetpointsThatWaitOnlyTheNewestIsSent) {
  auto* robot = dial(64);
  robot->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
  robot->keep_talking();
  robot->link.stall(true);
  for (int i = 0; i < 50; ++i) submit(set_setpoint(0.01F * static_cast<float>(i)), 3s);
  submit(set_duty(0.5F), 3s);  // of another kind: both are sent
  clock.run_for(700ms);
  robot->link.stall(false);
  clock.run_for(100ms);
  const auto commands = robot->commands();
  ASSERT_GE(commands.size(), 2u);
  ASSERT_LT(commands.size(), 6u) << "what fitted into the link before it stalled";
  EXPECT_EQ(commands.back().which_action, rheonaut_Command_set_duty_tag);
  EXPECT_FLOAT_EQ(commands[commands.size() - 2].action.set_setpoint.setpoint_m, 0.49F);
  const auto superseded = std::ranges::count_if(
      results, [](const auto& result) { return result->state == station::CommandState::superseded; });
  EXPECT_EQ(static_cast<std::size_t>(superseded) + commands.size(), 51u) << "each is sent, or ends as superseded";
}

// SAFETY: its time to live counts from when it was issued.
TEST_F(CommandOutcomeTest, WhatIsOlderThanItsLifeOnArrivalIsNotSentAndIsAccountedFor) {
  auto* robot = connect();
  station::CommandRequest request = request_of(set_duty(0.3F), 500ms);
  request.age = 500ms;
  request.life_from = "issued_at";
  submit(request);
  clock.settle();
  EXPECT_TRUE(robot->commands().empty());
  ASSERT_EQ(results.size(), 1u);
  EXPECT_EQ(results[0]->state, station::CommandState::expired);
  EXPECT_EQ(results[0]->reason, "too_old_on_arrival");
  EXPECT_EQ(results[0]->life_from, "issued_at");
  EXPECT_EQ(sink.commands.back().id, results[0]->id) << "it is recorded";
  request.age = 400ms;
  submit(request);
  clock.settle();
  ASSERT_EQ(robot->commands().size(), 1u);
  EXPECT_LE(robot->commands()[0].valid_until_robot_us, robot->robot_now_us() + 100'000);
}

TEST_F(CommandOutcomeTest, ARequestThatComesAgainUnderItsKeyIsNotSentAgain) {
  auto* robot = connect();
  station::CommandRequest request = request_of(set_duty(0.3F));
  request.key = "try-1";
  submit(request);
  submit(request);  // while it is on its way
  clock.settle();
  ASSERT_EQ(robot->commands().size(), 1u);
  accept(*robot, 0);
  submit(request);  // acknowledged, not seen yet
  clock.settle();
  show_duty(*robot, 0.3F, robot->robot_now_us());
  submit(request);  // ended
  clock.settle();
  EXPECT_EQ(robot->commands().size(), 1u);
  ASSERT_EQ(results.size(), 4u);
  for (const auto& result : results) EXPECT_EQ(result->id, results[0]->id);
  EXPECT_EQ(results[3]->state, station::CommandState::verified);

  request.arguments = R"({"duty":0.4})";
  submit(request);
  clock.settle();
  EXPECT_EQ(results.at(4).error().reason, "key_reused");
  request.key = "try-2";
  submit(request);
  clock.settle();
  EXPECT_EQ(robot->commands().size(), 2u);
}

// A station that restarted has forgotten, and the robot has not.
class SentBeforeTest : public CommandOutcomeTest {
 protected:
  // A request with a key that the robot has had before, from a station that was killed.
  void answer_duplicate(std::uint64_t effect_at_robot_us = 0) {
    robot = connect();
    station::CommandRequest request = request_of(set_duty(0.3F));
    request.key = "try-1";
    submit(request);
    clock.settle();
    EXPECT_EQ(robot->commands().at(0).command_id, station::command_id_of("r1", "test", "try-1"));
    protocol::RobotFrame answer = rheonaut_RobotFrame_init_zero;
    answer.which_body = rheonaut_RobotFrame_command_ack_tag;
    answer.body.command_ack.command_id = robot->commands()[0].command_id;
    answer.body.command_ack.result = rheonaut_COMMAND_RESULT_DUPLICATE;
    answer.body.command_ack.effect_at_robot_us = effect_at_robot_us;
    robot->send(answer);
    clock.settle();
    ASSERT_EQ(results.size(), 1U);
  }
  std::string end() const {
    const auto record = latest(results.at(0)->id);
    return std::string{station::text(record.state)} + ' ' + record.reason;
  }

  TestRobot* robot = nullptr;
};

// The robot answers the same when it had refused it.
TEST_F(SentBeforeTest, IsUnknownUntilTelemetryShowsIt) {
  answer_duplicate();
  EXPECT_EQ(end(), "unknown duplicate");
  show_duty(*robot, 0, robot->robot_now_us());
  EXPECT_EQ(end(), "unknown duplicate");
  clock.run_for(10ms);
  show_duty(*robot, 0.3F, robot->robot_now_us());
  EXPECT_EQ(end(), "verified duplicate");
}

TEST_F(SentBeforeTest, IsAcknowledgedOnceAnEventNamesIt) {
  answer_duplicate();
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_event_tag;
  frame.body.event.command_id = robot->commands()[0].command_id;
  frame.body.event.kind = rheonaut_EVENT_KIND_MODE_CHANGED;
  frame.body.event.event_robot_time_us = robot->robot_now_us();
  robot->send(frame);
  clock.settle();
  EXPECT_EQ(end(), "acknowledged named_by_event");
}

TEST_F(SentBeforeTest, IsAcknowledgedWhenTheRobotGivesTheTimeOfItsEffect) {
  answer_duplicate(1'000);
  EXPECT_EQ(end(), "acknowledged duplicate");
}

}  // namespace
}  // namespace server
