// A robot, and what must hold of it whatever happens. A breach prints its reason and aborts.
//
// After every call: the duty is finite and within the motor's range; latched is mode emergency and duty 0; a latch ends
// only by a clear that named its id, and no id comes twice.
// After every tick: nothing moves under a duty that nobody has renewed, nor after a silence longer than any time-out.
// In every frame: it decodes, is the longest frame's size at most, and says what its connection allows by then; samples
// are consecutive, exist, and agree with the mode of their batch; backfill is at most twice the live rate.
#pragma once

#include <optional>
#include <set>
#include <vector>

#include "robot_fw/core/robot.hpp"

namespace fuzz {

class WatchedRobot {
 public:
  explicit WatchedRobot(const robot_fw::RobotConfig& config);

  void tick(const robot_fw::Inputs& inputs, float dt_s);
  void open();
  void close();
  // Closes the connection when the robot asks for it, as a port does.
  void receive(protocol::Bytes bytes);
  // Returns the size.
  std::size_t transmit(std::size_t capacity);
  void transmit_all();
  // Sends it alone on a connection where nothing waits, and again. It is answered at once and runs once at most;
  // refused, it changes nothing, now or later: a copy that receives a ping instead drives on in the same way.
  void order(const protocol::Command& command);
  // Connects anew: every sample that the robot still holds arrives.
  void expect_every_sample();

  void pass(std::uint64_t us) { now_us_ += us; }
  std::uint64_t now_us() const { return now_us_; }
  std::uint64_t made() const { return made_; }
  std::uint64_t emergency_id() const { return robot_.emergency_id(); }
  std::uint64_t boot_id() const { return config_.boot_id; }
  float duty() const { return robot_.duty(); }
  const robot_fw::Inputs& last_inputs() const { return inputs_; }

 private:
  void check() const;
  void check_latch();
  void check_at_rest() const;
  void observe(protocol::Bytes bytes);
  void observe(const protocol::StationFrame& frame);
  void check_frame(const protocol::RobotFrame& frame);
  void check_telemetry(const protocol::Telemetry& batch);
  void check_live(const protocol::Telemetry& batch);
  protocol::CommandResult answer_to(const protocol::Command& command);
  void send(const protocol::StationFrame& frame);
  void check_twins(robot_fw::Robot with, robot_fw::Robot without) const;
  bool can_order() const { return open_ && up_ && between_frames_; }

  robot_fw::RobotConfig config_;
  robot_fw::Robot robot_;
  robot_fw::Inputs inputs_{};  // of the last tick
  std::uint64_t now_us_ = 0;
  std::uint64_t made_ = 0;  // samples

  // What the station said, as far as the robot can have received it.
  protocol::FrameReader reader_;
  bool open_ = false, up_ = false, between_frames_ = true, heard_welcome_ = false;
  std::optional<std::uint64_t> received_at_us_;
  std::uint64_t moves_until_us_ = 0;  // no manual duty lives longer
  std::set<std::uint64_t> cleared_ids_, latched_ids_;
  std::uint64_t latch_ = 0;

  // What the robot said on this connection.
  bool hello_sent_ = false;
  std::uint64_t live_next_seq_ = 0;
  bool live_may_skip_ = false;
  std::uint64_t backfill_credit_ = 0;
  std::uint64_t said_at_us_ = 0;
  std::vector<protocol::CommandAck> acks_;  // of the last transmit_all()
  std::optional<protocol::Telemetry> last_batch_;
  std::set<std::uint64_t>* arrived_ = nullptr;  // while every sample is counted
};

}  // namespace fuzz
