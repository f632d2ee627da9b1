// Words of tests about commands that wait on the robot for their time.
#pragma once

#include "server/link/command_window.hpp"
#include "tests/server/link/link_fixture.hpp"

namespace server {

class TimedTest : public LinkTest {
 protected:
  explicit TimedTest(const config::Envelope& envelope = config::Envelope{}) : LinkTest{envelope} {}

  std::uint64_t in_ms(std::uint64_t ms) const { return robot->robot_now_us() + ms * 1000; }
  station::CommandRequest timed(protocol::Command command, std::uint64_t at_us, const char* actor) const {
    command.has_execute_at_robot_us = true;
    command.execute_at_robot_us = at_us;
    station::CommandRequest request = request_of(command, 8s);
    request.actor = actor;
    request.until_verified = true;
    return request;
  }
  protocol::Command send_out(station::CommandRequest request) {
    submit(std::move(request));
    clock.settle();
    return robot->commands().back();
  }
  void accept_for_its_time(const protocol::Command& sent) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_command_ack_tag;
    frame.body.command_ack.command_id = sent.command_id;
    frame.body.command_ack.result = rheonaut_COMMAND_RESULT_ACCEPTED;
    frame.body.command_ack.effect_at_robot_us = sent.execute_at_robot_us;
    robot->send(frame);
    clock.settle();
  }
  protocol::Command admit(station::CommandRequest request) {
    const protocol::Command sent = send_out(std::move(request));
    accept_for_its_time(sent);
    return sent;
  }
  static protocol::Command moves_after_a_second() {
    protocol::Command schedule = rheonaut_Command_init_zero;
    schedule.which_action = rheonaut_Command_set_duty_schedule_tag;
    auto& entries = schedule.action.set_duty_schedule;
    entries.tick_count = entries.duty_count = 3;
    entries.tick[1] = 100;
    entries.tick[2] = 120;
    entries.duty[1] = 0.3F;
    return schedule;
  }
  // Of a robot that is latched, and whose motor runs all the same.
  void show_that_the_motor_runs_on() {
    for (std::uint64_t seq = 0; seq < 200; seq += 5) {
      auto frame = TestRobot::samples_frame(seq, 5, robot->robot_now_us(), 7);
      for (float& duty : frame.body.telemetry.duty) duty = 0.5F;
      robot->send(frame);
      clock.run_for(50ms);
    }
  }
  const station::CommandRecord& latest_of_kind(const std::string& kind) const {
    return *std::ranges::find(sink.commands.rbegin(), sink.commands.rend(), kind, &station::CommandRecord::kind);
  }
  std::vector<const char*> kinds() const {
    std::vector<const char*> found;
    for (const auto& command : robot->commands()) found.push_back(protocol::kind(command));
    return found;
  }
  std::size_t drops() const {
    return static_cast<std::size_t>(
        std::ranges::count_if(kinds(), [](const char* kind) { return kind == std::string{"drop_timed"}; }));
  }
  void control(station::ControlAction action, const char* actor) {
    EXPECT_TRUE(station.control({"r1", actor, "", action, station::kControlLease, "because"}));
    clock.settle();
  }
  static protocol::Command ping() {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_ping_tag;
    return command;
  }
  // What comes now waits in the station, until the robot answers.
  void fill_window() {
    for (std::size_t i = 0; i < link::CommandWindow::kMost; ++i) submit(ping(), 9s);
    clock.settle();
  }
  void answer_all() {
    for (std::size_t i = 0; i < robot->commands().size(); ++i) {
      robot->acknowledge(robot->commands()[i], rheonaut_COMMAND_RESULT_ACCEPTED);
      clock.settle();
    }
  }
  // The same boot, over a new connection.
  void come_back() {
    robot->link.cut();
    clock.settle();
    const std::int64_t booted_at_us = robot->booted_at_us;
    robot = dial();
    robot->booted_at_us = booted_at_us;
    robot->say_hello();
    ASSERT_TRUE(clock.run_until([&] { return !robot->commands().empty(); }, 1s));
    robot->keep_talking();
  }
  void accept_last() {
    robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED);
    clock.settle();
  }

  TestRobot* robot = connect();
};

}  // namespace server
