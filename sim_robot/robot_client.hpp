// Runs a simulated robot in real time and connects it to a station over TCP.
//
// Robot time is the host's steady clock since the robot booted, on time or late, in a tick or between two. Ticks are
// due at multiples of the period; late ones run before any byte is handed to the robot, so its time never goes back.
// After a stall (the process was stopped, the machine busy) the missed ones are skipped and counted. A tick never waits
// for the network: see station_connection.hpp. Owns robot and connection. One thread: that of `loop`, which must
// outlive the client.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdint>

#include "sim_robot/fleet_member.hpp"
#include "sim_robot/simulated_robot.hpp"

namespace sim_robot {

class RobotClient final : public FleetMember, private Speaker {
 public:
  RobotClient(boost::asio::io_context& loop, SimulatedRobotConfig config, StationAddress station, LinkLog log);

  // Boots now, ticks and connects until cancelled. Never returns otherwise.
  boost::asio::awaitable<void> run();

  // The parts of run(), for who has many robots.
  void boot(Clock::time_point at) override { booted_at_ = at; }
  void tick() override;
  void send() override;
  Clock::time_point next_tick_at() const override {
    return booted_at_ + std::chrono::microseconds(robot_.robot_time_us());
  }
  boost::asio::awaitable<void> stay_connected() override { return connection_.run(); }

  SampleCounts samples() const override;
  const StationConnection& connection() const override { return connection_; }
  const SimulatedRobot& robot() const { return robot_; }

 private:
  void on_opened() override { robot_.link_opened(catch_up()); }
  void on_closed() override { robot_.link_closed(catch_up()); }
  bool on_bytes(protocol::Bytes bytes) override { return robot_.receive(bytes, catch_up()); }
  std::size_t next_frame(std::uint8_t* out, std::size_t capacity) override;
  bool is_welcome() const override { return robot_.core().link_up(); }
  protocol::RefusalReason refusal() const override { return robot_.core().refusal(); }
  std::string refusal_detail() const override { return robot_.core().refusal_detail(); }

  boost::asio::awaitable<void> tick_for_ever();
  std::uint64_t catch_up();
  void watch_gaps();

  SimulatedRobot robot_;
  Clock::time_point booted_at_;  // robot time 0
  StationConnection connection_;
  std::uint64_t sent_ = 0, resent_ = 0;          // samples
  std::uint64_t gaps_ = 0, lost_before_ = 0;     // at the last tick
  std::uint64_t oldest_after_gap_ = UINT64_MAX;  // it is this while the latest gap grows
};

}  // namespace sim_robot
