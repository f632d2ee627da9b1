// A simulated robot and its station, connected, for tests that read like a log.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "sim_robot/lab/station_peer.hpp"

namespace robot_fw {

constexpr std::uint64_t kBootId = 0xB007;
constexpr std::uint64_t kTickUs = sim_robot::SimulatedRobot::kPeriodUs;

inline sim_robot::SimulatedRobotConfig with_boot_id(sim_robot::SimulatedRobotConfig config) {
  config.boot_id = kBootId;
  return config;
}

class DrivenRobot : public ::testing::Test {
 protected:
  explicit DrivenRobot(const sim_robot::SimulatedRobotConfig& config = {}) : robot(with_boot_id(config)) {
    station.welcome.samples_per_frame = 1;  // every sample is received in its tick
    station.connect();
    station.run(2);
  }

  // Sends a command, lets one tick pass and returns the answer.
  protocol::CommandAck order(const protocol::Command& command) {
    const std::uint64_t id = station.send(command);
    station.step();
    return station.ack_of(id).value_or(protocol::CommandAck{});
  }
  static std::string result(const protocol::CommandAck& ack) {
    return ack.result == rheonaut_COMMAND_RESULT_REJECTED ? protocol::text(ack.reason) : protocol::text(ack.result);
  }
  // The answer in one word: "accepted", "expired", ..., or the reason of a rejection.
  std::string answer(const protocol::Command& command) { return result(order(command)); }

  const Robot& core() const { return robot.core(); }
  const sim_robot::ReceivedSample& last() const { return station.samples.rbegin()->second; }
  std::string mode() const { return protocol::text(core().mode()); }
  int events_of(protocol::EventKind kind) const {
    int count = 0;
    for (const auto& event : station.events) count += event.kind == kind;
    return count;
  }
  // Manual, duty 0 and nothing that could move it.
  void expect_at_rest() {
    EXPECT_EQ(core().duty(), 0);
    EXPECT_EQ(mode(), "manual");
    station.run(20);
    EXPECT_EQ(last().duty, 0);
    EXPECT_FALSE(last().setpoint_m.has_value());
    EXPECT_EQ(last().disturbance_m, 0);
  }

  sim_robot::SimulatedRobot robot;
  sim_robot::StationPeer station{robot};
};

}  // namespace robot_fw
