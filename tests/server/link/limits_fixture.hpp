// The vocabulary of the tests of limits: a robot in auto, in a fluid whose limits others narrow.
#pragma once

#include <gmock/gmock.h>

#include <string>
#include <utility>

#include "tests/server/link/timed_fixture.hpp"

namespace server {

// Steps of 0.25 m, in auto at 0; in water a duty of 0.5 at most, in oil 10 s at power.
class TimedLimitsTest : public TimedTest {
 protected:
  TimedLimitsTest() : TimedTest{envelope()} {
    EXPECT_TRUE(station.set_fluid("r1", "non_newtonian", {"a", "", 0}));
    show_setpoint(0);
  }
  static config::Envelope envelope() {
    config::CommandLimits limits, water, oil, honey;
    limits.setpoint_step_m = water.setpoint_step_m = 0.25;
    water.duty_max = 0.5;
    oil.power_s = 10;
    honey.setpoint_max_m = 0.1;
    return config::Envelope{limits, {{"water", water}, {"oil", oil}, {"honey", honey}}};
  }
  void show_setpoint(float setpoint_m) {
    auto frame = TestRobot::samples_frame(next_seq_++, 1, robot->robot_now_us(), 0);
    frame.body.telemetry.mode = rheonaut_MODE_AUTO;
    frame.body.telemetry.has_setpoint_m = true;
    frame.body.telemetry.setpoint_m = setpoint_m;
    robot->send(frame);
    clock.settle();
  }
  static protocol::Command at_power(std::uint32_t lasts_s) {
    protocol::Command command = rheonaut_Command_init_zero;
    command.which_action = rheonaut_Command_set_duty_schedule_tag;
    auto& schedule = command.action.set_duty_schedule;
    schedule.tick_count = schedule.duty_count = 2;
    schedule.tick[1] = lasts_s * 100;
    schedule.duty[0] = 1;
    return command;
  }
  void show_a_second_at_power(std::uint64_t from_us) {
    for (std::uint64_t shown = 0; shown < 100; shown += 5, next_seq_ += 5) {
      auto frame = TestRobot::samples_frame(next_seq_, 5, from_us + shown * 10'000, 0);
      for (float& duty : frame.body.telemetry.duty) duty = 1;
      robot->send(frame);
      clock.settle();
    }
  }
  void send_event(protocol::EventKind kind) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_event_tag;
    frame.body.event.kind = kind;
    frame.body.event.event_robot_time_us = robot->robot_now_us();
    robot->send(frame);
    clock.settle();
  }
  void show_position(float position_m) {  // in manual
    auto frame = TestRobot::samples_frame(next_seq_++, 1, robot->robot_now_us(), 0);
    frame.body.telemetry.position_m[0] = position_m;
    robot->send(frame);
    clock.settle();
  }
  station::CommandRequest now(protocol::Command command, microseconds time_to_live = 1s) const {
    station::CommandRequest request = request_of(command, time_to_live);
    request.actor = "a";
    return request;
  }
  // What speaks against it; empty when it is sent.
  std::string refusal(station::CommandRequest request) {
    const std::size_t before = results.size();
    submit(std::move(request));
    clock.settle();
    return results.size() == before ? "" : results.back().error().reason + ": " + results.back().error().detail;
  }

 private:
  std::uint64_t next_seq_ = 0;
};

}  // namespace server
