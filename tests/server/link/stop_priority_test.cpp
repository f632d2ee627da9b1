// The emergency stop: ahead of everything, kept and repeated until a robot has obeyed, timed.
#include <algorithm>
#include <string>

#include "tests/server/link/link_fixture.hpp"

namespace server {
namespace {

TEST_F(LinkTest, AnEmergencyStopGoesAheadOfWhatWaitsAndReplacesIt) {
  auto* robot = connect();
  for (int i = 0; i < 5; ++i) submit(set_duty(0.3F));
  stop_robot();
  clock.settle();
  ASSERT_EQ(robot->commands().size(), 1u) << "the queued commands must never reach the robot";
  EXPECT_EQ(robot->commands()[0].which_action, rheonaut_Command_emergency_stop_tag);
  EXPECT_EQ(results.size(), 5u);
  for (const auto& result : results) EXPECT_EQ(result->state, station::CommandState::superseded);
}

// SAFETY: not behind the samples of a fleet, nor in a pause; what that means PollSetTest shows.
TEST_F(LinkTest, WhatARobotSendsIsAwaitedUntilItHasAnsweredAStop) {
  auto* robot = connect();
  ASSERT_EQ(robot->heartbeats().size(), 1U);
  EXPECT_EQ(robot->link.second_pace(), net::ReadPace::awaited) << "a probe of its clock, too";
  protocol::RobotFrame answer = rheonaut_RobotFrame_init_zero;
  answer.which_body = rheonaut_RobotFrame_heartbeat_tag;
  answer.body.heartbeat.echo_station_time_us = robot->heartbeats()[0].station_time_us;
  answer.body.heartbeat.echo_received_at_robot_us = robot->robot_now_us();
  robot->send(answer);
  clock.settle();
  EXPECT_NE(robot->link.second_pace(), net::ReadPace::awaited);
  stop_robot();
  clock.settle();
  EXPECT_EQ(robot->link.second_pace(), net::ReadPace::awaited);
  protocol::Command other = robot->commands().at(0);
  other.command_id += 1;
  robot->acknowledge(other, rheonaut_COMMAND_RESULT_ACCEPTED, 0);
  clock.settle();
  EXPECT_EQ(robot->link.second_pace(), net::ReadPace::awaited) << "of another command";
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  clock.settle();
  EXPECT_NE(robot->link.second_pace(), net::ReadPace::awaited);
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
  EXPECT_EQ(results.at(1)->state, station::CommandState::acknowledged);
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
  EXPECT_EQ(results[0]->state, station::CommandState::queued);
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
  station::CommandRecord kept;
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
  EXPECT_LE(robot->commands().size(), link::RobotOutbox::kMaxQueuedStops);
  for (const auto& command : robot->commands()) robot->acknowledge(command, rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  ASSERT_TRUE(clock.run_until([&] { return results.size() == 100; }, 2s));
  for (const auto& result : results) EXPECT_EQ(result->state, station::CommandState::acknowledged);
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

TEST_F(LinkTest, OnePressThatComesByTwoWaysIsOneStop) {
  auto* robot = connect();
  stop_robot(1s, "press-1");
  stop_robot(1s, "press-1");  // before the robot has answered
  clock.settle();
  ASSERT_EQ(robot->commands().size(), 1u);
  robot->acknowledge(robot->commands()[0], rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  clock.settle();
  stop_robot(1s, "press-1");  // after it
  clock.settle();
  ASSERT_EQ(results.size(), 3u);
  for (const auto& result : results) {
    EXPECT_EQ(result->id, results[0]->id);
    EXPECT_EQ(result->emergency_id, 9u);
  }
  EXPECT_EQ(robot->commands().size(), 1u);
  stop_robot(1s, "press-2");
  clock.settle();
  EXPECT_EQ(robot->commands().size(), 2u) << "another press is another stop";
}

// SAFETY: a client that uses one key for all its stops stops every time.
TEST_F(LinkTest, AKeyThatWasUsedIsNoReasonNotToStop) {
  auto* robot = connect();
  stop_robot(1s, "stop");
  clock.settle();
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  clock.run_for(10ms);
  submit(clear_emergency(9));
  clock.settle();
  robot->acknowledge(robot->commands().at(1), rheonaut_COMMAND_RESULT_ACCEPTED, 0);
  clock.settle();
  ASSERT_FALSE(station.find("r1")->latched());
  stop_robot(1s, "stop");
  clock.settle();
  ASSERT_EQ(robot->commands().size(), 3u) << "the robot is no longer latched by the first";
  EXPECT_NE(robot->commands()[2].command_id, robot->commands()[0].command_id);
  robot->acknowledge(robot->commands()[2], rheonaut_COMMAND_RESULT_ACCEPTED, 10);
  clock.run_for(11s);
  stop_robot(1s, "stop");
  clock.settle();
  EXPECT_EQ(robot->commands().size(), 4u) << "nor does a press of long ago answer this one";
}

TEST_F(LinkTest, AStopIsTimedFromItsRequestToDutyZeroInTelemetry) {
  auto* robot = connect();
  robot->link.stall(true);
  tasks.spawn("stop", [](station::Station& to, std::int64_t received_us) -> boost::asio::awaitable<void> {
    station::StopRequest request{"r1", "test", "", "", received_us};
    co_await to.emergency_stop(std::move(request), 1s);
  }(station, clock.steady_us() - 300));
  clock.run_for(2ms);
  robot->link.stall(false);
  clock.settle();
  robot->acknowledge(robot->commands().at(0), rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  clock.run_for(5ms);
  robot->send_samples(0, 1, robot->robot_now_us(), 9);
  clock.settle();
  const station::CommandRecord& stop = sink.commands.back();
  EXPECT_EQ(stop.state, station::CommandState::verified);
  EXPECT_EQ(stop.sent_after_us, 300);
  EXPECT_EQ(stop.acknowledged_after_us, 2300);
  EXPECT_EQ(stop.verified_after_us, 7300);
  EXPECT_EQ(station.stop_times().sent.sum(), 300);
  EXPECT_EQ(station.stop_times().acknowledged.sum(), 2300);
  EXPECT_EQ(station.stop_times().verified.sum(), 7300);
}

TEST_F(LinkTest, AStopThatWaitsForARobotIsNotTimed) {
  station.restore({{"r1", 0, 0}}, {});
  stop_robot(10ms);
  clock.run_for(60s);
  auto* robot = dial();
  robot->say_hello();
  ASSERT_TRUE(clock.run_until([&] { return !robot->commands().empty(); }, 1s));
  robot->acknowledge(robot->commands()[0], rheonaut_COMMAND_RESULT_ACCEPTED, 9);
  clock.settle();
  EXPECT_EQ(sink.commands.back().acknowledged_after_us / 1'000'000, 60) << "the record says how long it took";
  EXPECT_EQ(station.stop_times().acknowledged.sum(), 0);
}

}  // namespace
}  // namespace server
