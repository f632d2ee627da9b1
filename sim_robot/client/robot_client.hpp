// Runs a simulated robot in real time and connects it to a station over TCP.
//
// True time is the host's steady clock since the robot booted first, on time or late, in a tick or between two. Ticks
// are due at multiples of the period; late ones run before any byte is handed to the robot, so its time never goes
// back. After a stall (the process was stopped, the machine busy) the missed ones are skipped and counted. A tick never
// waits for the network: see station_connection.hpp. A reboot leaves the connection open, and resets it when the robot
// is back. With a handshake, as TLS on the robot's board, the robot dials only at rest, and no tick runs until the
// handshake is over.
// Faults of the link need a proxy between it and the station: `link`, whose address is given as the station's, and
// which must outlive the client. Null: there is none. A robot whose loop is blocked neither reads nor writes. Owns
// robot and connection. One thread: that of `loop`, which must outlive the client.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <optional>
#include <vector>

#include "sim_robot/client/fleet_member.hpp"
#include "sim_robot/robot/robot_life.hpp"
#include "sim_robot/scenario/fault_timeline.hpp"

namespace sim_robot {

class RobotClient final : public FleetMember, private Speaker {
 public:
  RobotClient(boost::asio::io_context& loop, SimulatedRobotConfig config, StationAddress station, LinkLog log,
              std::chrono::milliseconds handshake = {}, std::vector<TimedFault> faults = {},
              FaultyLink* link = nullptr);

  // Boots now, ticks and connects until cancelled. Never returns otherwise.
  boost::asio::awaitable<void> run();

  // The parts of run(), for a fleet.
  void boot(Clock::time_point at) override { booted_at_ = at; }
  bool tick() override;
  void prefetch() const override { robot().prefetch(); }
  void send() override { connection_.flush(); }
  // A robot without power or with a blocked loop is polled as often as any: a fault may be due, or end.
  Clock::time_point next_tick_at() const override;
  boost::asio::awaitable<void> stay_connected() override { return connection_.run(); }

  void reboot(const Reboot& reboot);

  SampleCounts samples() const override;
  const StationConnection& connection() const override { return connection_; }
  const SimulatedRobot& robot() const { return life_.robot(); }
  // For injecting faults while it runs, on the same thread.
  SimulatedRobot& robot() { return life_.robot(); }
  FaultTimeline& faults() { return faults_; }
  FaultyRobot faulty() { return {life_, link_}; }
  RobotLife& life() { return life_; }  // for its clock

 private:
  void on_opened() override;
  void on_closed() override { life_.robot().link_closed(catch_up()); }
  bool on_bytes(protocol::Bytes bytes) override;
  std::size_t next_frame(std::uint8_t* out, std::size_t capacity) override;
  bool is_welcome() const override { return life_.core().link_up(); }
  protocol::RefusalReason refusal() const override { return life_.core().refusal(); }
  std::string refusal_detail() const override { return life_.core().refusal_detail(); }
  bool ring_has_room() const override;
  bool may_dial() const override;
  bool is_listening() const override { return !life_.is_blocked(); }
  std::optional<std::chrono::milliseconds> begin_handshake() override;

  boost::asio::awaitable<void> tick_for_ever();
  std::uint64_t catch_up();
  void follow_reboot();
  void watch_gaps();

  RobotLife life_;
  std::chrono::milliseconds handshake_;
  FaultTimeline faults_;
  FaultyLink* link_;
  Clock::time_point booted_at_;  // true time 0
  StationConnection connection_;
  int boots_ = 1;
  std::uint64_t sent_ = 0, resent_ = 0;          // samples
  std::uint64_t gaps_ = 0, lost_before_ = 0;     // at the last tick
  std::uint64_t oldest_after_gap_ = UINT64_MAX;  // it is this while the latest gap grows
};

}  // namespace sim_robot
