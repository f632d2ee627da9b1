// The way of a command: sent, answered, expired, overtaken by an emergency stop; and the way of that stop.
#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

TEST_F(LinkTest, ACommandIsAcknowledgedWithTheTimeOfItsEffect) {
  auto* robot = connect();
  submit(set_duty(0.3F));
  clock.settle();
  ASSERT_EQ(robot->commands().size(), 1u);
  const auto command = robot->commands()[0];
  EXPECT_EQ(command.boot_id, 77u);
  EXPECT_NE(command.command_id, 0u);
  EXPECT_LE(command.valid_until_robot_us, robot->robot_now_us() + 2'000'000);
  robot->acknowledge(command, rheonaut_COMMAND_RESULT_ACCEPTED);
  ASSERT_TRUE(clock.run_until([&] { return !results.empty(); }, 100ms));
  EXPECT_EQ(results[0]->state, CommandState::acknowledged);
  EXPECT_EQ(results[0]->effect_at_robot_us, robot->robot_now_us());
  EXPECT_EQ(sink.commands.front().state, CommandState::queued);
  EXPECT_EQ(sink.commands.back().state, CommandState::acknowledged);
}

TEST_F(LinkTest, ARefusalOfTheRobotReachesTheCaller) {
  auto* robot = connect();
  submit(set_duty(0.3F));
  clock.settle();
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_REJECTED, 0, rheonaut_REJECT_REASON_WRONG_MODE);
  ASSERT_TRUE(clock.run_until([&] { return !results.empty(); }, 100ms));
  EXPECT_EQ(results[0]->state, CommandState::rejected);
  EXPECT_EQ(results[0]->reason, "wrong_mode");
}

TEST_F(LinkTest, ACommandWithoutAnswerExpires) {
  connect();
  submit(set_duty(0.3F), 500ms);
  ASSERT_TRUE(clock.run_until([&] { return !results.empty(); }, 3s));
  EXPECT_EQ(results[0]->state, CommandState::expired);
  EXPECT_EQ(results[0]->reason, "no_answer");
}

TEST_F(LinkTest, ACommandThatWaitedLongerThanItsLifeIsNeverSent) {
  auto* robot = dial(64);
  robot->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
  robot->keep_talking();
  robot->link.stall(true);  // the station's bytes pile up, and the robot's arrive late
  for (int i = 0; i < 20; ++i) submit(set_duty(0.01F * static_cast<float>(i)), 300ms);
  clock.run_for(600ms);
  robot->link.stall(false);
  ASSERT_TRUE(clock.run_until([&] { return results.size() == 20; }, 3s));
  EXPECT_LT(robot->commands().size(), 5u) << "what fitted into the link before it stalled";
  for (const auto& result : results) EXPECT_EQ(result->state, CommandState::expired);
}

TEST_F(LinkTest, RefusesWithoutSendingWhatIsOutsideTheEnvelope) {
  auto* robot = connect();
  submit(set_duty(1.5F));
  submit(set_duty(std::numeric_limits<float>::quiet_NaN()));
  submit(set_duty(0.1F), 11s);
  clock.settle();
  ASSERT_EQ(results.size(), 3u);
  for (const auto& result : results) EXPECT_EQ(result.error().code, ErrorCode::invalid);
  EXPECT_TRUE(robot->commands().empty());
}

TEST_F(LinkTest, AnUnknownAndADisconnectedRobotAreToldApart) {
  submit(set_duty(0));
  clock.settle();
  EXPECT_EQ(results.at(0).error().code, ErrorCode::not_found);
  station.restore({{"r1", 0, 0}}, {});
  submit(set_duty(0));
  clock.settle();
  EXPECT_EQ(results.at(1).error().code, ErrorCode::not_connected);
}

TEST_F(LinkTest, CommandsOnTheirWayFailWhenTheLinkIsLost) {
  auto* robot = connect();
  submit(set_duty(0.3F));
  clock.settle();
  robot->link.cut();
  ASSERT_TRUE(clock.run_until([&] { return !results.empty(); }, 100ms));
  EXPECT_EQ(results[0]->state, CommandState::failed);
  EXPECT_EQ(results[0]->reason, "link_lost");
}

TEST_F(LinkTest, AnEmergencyStopGoesAheadOfWhatWaitsAndReplacesIt) {
  auto* robot = connect();
  for (int i = 0; i < 5; ++i) submit(set_duty(0.3F));
  stop_robot();
  clock.settle();
  ASSERT_EQ(robot->commands().size(), 1u) << "the queued commands must never reach the robot";
  EXPECT_EQ(robot->commands()[0].which_action, rheonaut_Command_emergency_stop_tag);
  EXPECT_EQ(results.size(), 5u);
  for (const auto& result : results) EXPECT_EQ(result->reason, "superseded_by_emergency_stop");
}

TEST_F(LinkTest, AStopLatchesTheStationUntilItIsCleared) {
  auto* robot = connect();
  stop_robot();
  clock.settle();
  submit(set_duty(0.1F));
  clock.settle();
  EXPECT_EQ(results.at(0).error().reason, "latched") << "before the robot has answered";
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  clock.settle();
  EXPECT_EQ(results.at(1)->state, CommandState::acknowledged);
  EXPECT_EQ(results.at(1)->emergency_id, 9u);
  submit(set_duty(0.1F));
  clock.settle();
  EXPECT_EQ(results.at(2).error().reason, "latched");
  clock.run_for(10ms);
  submit(clear_emergency(9));
  clock.settle();
  robot->acknowledge(robot->commands().at(1), rheonaut_COMMAND_RESULT_ACCEPTED, 0);
  submit(set_duty(0.1F));
  clock.settle();
  EXPECT_EQ(robot->commands().size(), 2u) << "the clear's answer and the duty crossed";
  submit(set_duty(0.1F));
  clock.settle();
  EXPECT_EQ(robot->commands().size(), 3u);
}

TEST_F(LinkTest, TelemetryFromBeforeTheStopDoesNotUnlatch) {
  auto* robot = connect();
  const auto before_us = robot->robot_now_us();
  clock.run_for(10ms);
  stop_robot();
  clock.settle();
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  robot->send_samples(0, 1, before_us, 0);
  clock.settle();
  EXPECT_EQ(station.find("r1")->context.emergency_id, 9u);
  robot->send_samples(1, 1, robot->robot_now_us(), 9);
  clock.settle();
  EXPECT_EQ(station.find("r1")->context.emergency_id, 9u);
}

TEST_F(LinkTest, AStopForADeadLinkIsKeptAndSentFirstAfterTheHello) {
  auto* robot = connect();
  robot->link.cut();
  ASSERT_TRUE(clock.run_until([&] { return !connected(); }, 2s));
  stop_robot(100ms);
  ASSERT_TRUE(clock.run_until([&] { return !results.empty(); }, 1s));
  EXPECT_EQ(results[0]->state, CommandState::queued);
  EXPECT_TRUE(station.find("r1")->pending_stop.has_value());

  auto* again = dial();
  again->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return again->frames.size() >= 2; }, 1s));
  EXPECT_EQ(again->frames[0].which_body, rheonaut_StationFrame_welcome_tag);
  ASSERT_EQ(again->frames[1].which_body, rheonaut_StationFrame_command_tag);
  EXPECT_EQ(again->frames[1].body.command.which_action, rheonaut_Command_emergency_stop_tag);
  EXPECT_EQ(again->frames[1].body.command.command_id, results[0]->id);

  submit(clear_emergency(9));
  clock.settle();
  EXPECT_EQ(results.at(1).error().reason, "stop_pending") << "no clear while the stop is on its way";

  again->link.cut();  // before it could acknowledge
  clock.settle();
  auto* third = dial();
  third->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return third->frames.size() >= 2; }, 1s));
  third->acknowledge(third->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  clock.settle();
  EXPECT_FALSE(station.find("r1")->pending_stop.has_value());
}

TEST_F(LinkTest, AStopOfAnEarlierStationIsSentWhenTheRobotReturns) {
  CommandRecord kept;
  kept.id = 1234;
  kept.robot_id = "r1";
  kept.kind = "emergency_stop";
  station.restore({}, {kept});
  auto* robot = dial();
  robot->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return !robot->commands().empty(); }, 1s));
  EXPECT_EQ(robot->commands()[0].command_id, 1234u);
}

TEST_F(LinkTest, ARobotThatLostItsLatchInAResetIsStoppedAgain) {
  auto* robot = connect();
  stop_robot();
  clock.settle();
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  clock.settle();
  robot->link.cut();
  clock.run_for(1s);
  auto* rebooted = dial();
  auto hello = TestRobot::hello_frame();
  hello.body.hello.boot_id = 78;
  rebooted->send(hello);
  ASSERT_TRUE(clock.run_until([&] { return !rebooted->commands().empty(); }, 1s));
  EXPECT_EQ(rebooted->commands()[0].which_action, rheonaut_Command_emergency_stop_tag);
}

TEST_F(LinkTest, ManyStopsAreBoundedAndAllAnswered) {
  auto* robot = connect();
  for (int i = 0; i < 100; ++i) stop_robot(1s);
  clock.settle();
  EXPECT_LE(robot->commands().size(), RobotSession::kMaxQueuedStops);
  for (const auto& command : robot->commands()) robot->acknowledge(command, rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  ASSERT_TRUE(clock.run_until([&] { return results.size() == 100; }, 2s));
  for (const auto& result : results) EXPECT_EQ(result->state, CommandState::acknowledged);
}

TEST_F(LinkTest, TheAnswerToAnEarlierStopDoesNotSettleALaterOne) {
  auto* robot = connect();
  stop_robot(100ms);
  clock.settle();
  stop_robot(100ms);
  clock.settle();
  ASSERT_EQ(robot->commands().size(), 2u);
  robot->acknowledge(robot->commands()[0], rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  clock.settle();
  EXPECT_TRUE(station.find("r1")->pending_stop.has_value()) << "the second has not arrived";
  submit(clear_emergency(9));
  clock.settle();
  EXPECT_EQ(results.back().error().reason, "stop_pending");
  robot->link.cut();
  clock.settle();
  auto* again = dial();
  again->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return !again->commands().empty(); }, 1s));
  EXPECT_EQ(again->commands()[0].command_id, robot->commands()[1].command_id);
}

TEST_F(LinkTest, AStopThatTheRobotRefusesIsSentAgainAndStaysPending) {
  auto* robot = connect();
  stop_robot(100ms);
  clock.settle();
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_REJECTED, 0, rheonaut_REJECT_REASON_UNSUPPORTED);
  clock.settle();
  EXPECT_TRUE(station.find("r1")->pending_stop.has_value());
  ASSERT_TRUE(clock.run_until([&] { return robot->commands().size() == 2; }, 1300ms));
  EXPECT_EQ(robot->commands()[1].command_id, robot->commands()[0].command_id);
}

TEST_F(LinkTest, AClearThatTookEffectBeforeTheLatestStopDoesNotUnlatch) {
  auto* robot = connect();
  stop_robot();
  clock.settle();
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  clock.run_for(10ms);
  submit(clear_emergency(9));
  stop_robot();
  clock.settle();
  const auto commands = robot->commands();
  ASSERT_GE(commands.size(), 2u);
  const auto cleared_at_us = robot->robot_now_us();
  clock.run_for(1ms);
  robot->acknowledge(commands.back(), rheonaut_COMMAND_RESULT_ACCEPTED, 10);
  clock.settle();
  EXPECT_EQ(station.find("r1")->context.emergency_id, 10u);
  protocol::RobotFrame late = rheonaut_RobotFrame_init_zero;  // the clear's answer, sent behind the stop's
  late.which_body = rheonaut_RobotFrame_command_ack_tag;
  for (const auto& command : commands) {
    if (command.which_action == rheonaut_Command_clear_emergency_tag)
      late.body.command_ack.command_id = command.command_id;
  }
  late.body.command_ack.result = rheonaut_COMMAND_RESULT_ACCEPTED;
  late.body.command_ack.effect_at_robot_us = cleared_at_us;
  robot->send(late);
  clock.settle();
  EXPECT_EQ(station.find("r1")->context.emergency_id, 10u);
}

TEST_F(LinkTest, StopsForARobotThatIsAwayAreOneStop) {
  station.restore({{"r1", 0, 0}}, {});
  for (int i = 0; i < 1000; ++i) stop_robot(10ms);
  ASSERT_TRUE(clock.run_until([&] { return results.size() == 1000; }, 1s));
  for (const auto& result : results) EXPECT_EQ(result->id, results[0]->id);
  auto* robot = dial();
  robot->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return !robot->commands().empty(); }, 1s));
  EXPECT_EQ(robot->commands().size(), 1u);
}

TEST_F(LinkTest, TheLatchOutlivesTheStation) {
  station.restore({{"r1", 77, 9}}, {});
  auto* rebooted = dial();
  auto hello = TestRobot::hello_frame();
  hello.body.hello.boot_id = 78;
  rebooted->send(hello);
  ASSERT_TRUE(clock.run_until([&] { return !rebooted->commands().empty(); }, 1s));
  EXPECT_EQ(rebooted->commands()[0].which_action, rheonaut_Command_emergency_stop_tag);
  submit(set_duty(0.1F));
  clock.settle();
  EXPECT_EQ(results.at(0).error().reason, "latched");
}

}  // namespace
}  // namespace server
