// Words of tests about commands that wait on the robot for their time.
#pragma once

#include "tests/server/link/link_fixture.hpp"

namespace server {

class TimedTest : public LinkTest {
 protected:
  explicit TimedTest(const Envelope& envelope = Envelope{}) : LinkTest{envelope} {}

  std::uint64_t in_ms(std::uint64_t ms) const { return robot->robot_now_us() + ms * 1000; }
  CommandRequest timed(protocol::Command command, std::uint64_t at_us, const char* actor) const {
    command.has_execute_at_robot_us = true;
    command.execute_at_robot_us = at_us;
    CommandRequest request = request_of(command, 8s);
    request.actor = actor;
    request.until_verified = true;
    return request;
  }
  protocol::Command take_in(CommandRequest request) {
    submit(std::move(request));
    clock.settle();
    const protocol::Command sent = robot->commands().back();
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_command_ack_tag;
    frame.body.command_ack.command_id = sent.command_id;
    frame.body.command_ack.result = rheonaut_COMMAND_RESULT_ACCEPTED;
    frame.body.command_ack.effect_at_robot_us = sent.execute_at_robot_us;
    robot->send(frame);
    clock.settle();
    return sent;
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
  void control(ControlAction action, const char* actor) {
    EXPECT_TRUE(station.control({"r1", actor, "", action, kControlLife, "because"}));
    clock.settle();
  }
  static protocol::Command ping() {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_ping_tag;
    return command;
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
  const CommandRecord& latest(CommandId id) const {
    return *std::ranges::find(sink.commands.rbegin(), sink.commands.rend(), id, &CommandRecord::id);
  }
  void accept_last() {
    robot->acknowledge(robot->commands().back(), rheonaut_COMMAND_RESULT_ACCEPTED);
    clock.settle();
  }

  TestRobot* robot = connect();
};

}  // namespace server
