// A station with its robot link in virtual time, a fake archive, and words to talk about them.
#pragma once

#include <gtest/gtest.h>

#include "server/link/robot_listener.hpp"
#include "tests/server/link/test_robot.hpp"

namespace server {

using namespace std::chrono_literals;

class LinkTest : public ::testing::Test {
 public:
  explicit LinkTest(const config::Envelope& envelope = config::Envelope{})
      : station{loop, clock, envelope, config::LinkTimes{}} {
    station.add_sink(sink);
  }
  ~LinkTest() override {
    tasks.stop();
    clock.settle();
  }

 protected:
  TestRobot* dial(std::size_t capacity_bytes = 64 * 1024) {
    robots_.push_back(std::make_unique<TestRobot>(loop, clock, tasks, listener, capacity_bytes));
    return robots_.back().get();
  }

  // A robot that is welcomed and goes on talking.
  TestRobot* connect() {
    auto* robot = dial();
    robot->say_hello();
    EXPECT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
    robot->keep_talking();
    clock.settle();
    return robot;
  }

  // Submits without waiting for the end; the result appears in `results`.
  static station::CommandRequest request_of(protocol::Command action, microseconds time_to_live = 2s) {
    station::CommandRequest request;
    request.robot_id = "r1";
    request.action = action;
    request.actor = "test";
    request.time_to_live = time_to_live;
    return request;
  }
  void submit(station::CommandRequest request) { tasks.spawn("submit", run_submit(std::move(request))); }
  void submit(protocol::Command action, microseconds time_to_live = 2s) { submit(request_of(action, time_to_live)); }
  // The newest record of a command.
  const station::CommandRecord& latest(station::CommandId id) const {
    return *std::ranges::find(sink.commands.rbegin(), sink.commands.rend(), id, &station::CommandRecord::id);
  }
  void stop_robot(microseconds patience = 1s, std::string key = "") {
    tasks.spawn("stop", run_stop({"r1", "test", "", std::move(key), 0}, patience));
  }

  static protocol::Command set_duty(float duty) {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_set_duty_tag;
    command.action.set_duty.duty = duty;
    return command;
  }
  static protocol::Command set_setpoint(float setpoint_m) {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_set_setpoint_tag;
    command.action.set_setpoint.setpoint_m = setpoint_m;
    return command;
  }
  static protocol::Command clear_emergency(std::uint64_t emergency_id) {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_clear_emergency_tag;
    command.action.clear_emergency.emergency_id = emergency_id;
    return command;
  }

  bool connected() const {
    const station::RobotState* robot = station.find("r1");
    return robot != nullptr && robot->link == station::LinkState::connected;
  }

  boost::asio::io_context loop;
  VirtualClock clock{loop};
  runtime::TaskGroup tasks{loop};
  station::Station station;
  RecordingSink sink;
  FakeArchive archive;
  static constexpr net::ConnectionLimits kPlaces{400, 100, 50, 300};
  net::PortAccess access{{clock, "robot port", kPlaces}, nullptr};
  link::RobotListener listener{loop,  clock, tasks, station, archive, {boost::asio::ip::address_v4::loopback(), 0},
                               false, access};
  std::vector<Result<station::CommandRecord>> results;

 private:
  boost::asio::awaitable<void> run_submit(station::CommandRequest request) {
    auto result = co_await station.submit(std::move(request));
    results.push_back(std::move(result));
  }
  boost::asio::awaitable<void> run_stop(station::StopRequest request, microseconds patience) {
    auto result = co_await station.emergency_stop(std::move(request), patience);
    results.push_back(std::move(result));
  }

  std::vector<std::unique_ptr<TestRobot>> robots_;
};

}  // namespace server
