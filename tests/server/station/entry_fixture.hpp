// One robot's entry, with a connection that keeps what it is given: for tests of one part of the station at a time.
#pragma once

#include <gtest/gtest.h>

#include <set>
#include <stdexcept>
#include <vector>

#include "server/station/robot_entry.hpp"
#include "server/station/state/station_sink.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {

class KeepingLink final : public station::RobotLink {
 public:
  const station::RobotId& robot_id() const override { return id; }
  bool send(const protocol::Command& command, std::int64_t) override {
    if (!is_full) sent.push_back(command);
    return !is_full;
  }
  bool withdraw(station::CommandId id_of_command) override { return can_withdraw.contains(id_of_command); }
  void send_emergency_stop(const protocol::Command& command) override {
    if (is_broken) throw std::runtime_error{"no memory"};
    stops.push_back(command.command_id);
  }
  void acknowledge(std::uint64_t, std::uint64_t) override {}
  void request_resend(std::uint64_t, std::uint64_t) override {}
  void request_event_resend() override {}
  void close(const std::string& reason) override { closed_because = reason; }

  station::RobotId id = "r1";
  bool is_full = false, is_broken = false;
  std::set<station::CommandId> can_withdraw;
  std::vector<protocol::Command> sent;
  std::vector<station::CommandId> stops;
  std::string closed_because;
};

class EntryTest : public ::testing::Test {
 protected:
  EntryTest() {
    robot.id = "r1";
    robot.boot_id = 7;
    robot.sample_period_us = 10'000;
    robot.latest_robot_time_us = 1'000'000;
    robot.last_received_steady_us = clock.steady_us();
    entry.link = &link;
  }

  static protocol::Command set_duty(float duty) {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_set_duty_tag;
    command.action.set_duty.duty = duty;
    return command;
  }
  // Of an actor; queued, and waiting for its answer.
  std::shared_ptr<station::PendingCommand> add(const protocol::Command& command,
                                               const std::string& actor = "session:1") {
    station::CommandRequest request;
    request.robot_id = robot.id;
    request.action = command;
    request.actor = actor;
    auto pending = make_pending(loop, clock, request, robot);
    entry.commands.add(pending);
    return pending;
  }

  boost::asio::io_context loop;
  VirtualClock clock{loop};
  station::RobotState robot;
  KeepingLink link;
  station::RobotEntry entry{robot};
};

// Keeps the states of the commands that are published.
class KeepingSink final : public station::StationSink {
 public:
  void on_command(const station::CommandRecord& record) override { states.push_back(record.state); }
  void on_event(const station::RobotState&, const station::RobotEvent& event) override { events.push_back(event); }
  std::vector<station::CommandState> states;
  std::vector<station::RobotEvent> events;
};

}  // namespace server
