// What a minimal station has received from its robot, and its answers.
//
// Everything received counts as stored at once. A sample that the robot no longer holds is final: the acknowledgement
// passes over it, and lost_samples() counts it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "protocol/frame.hpp"

namespace sim_robot {

// One sample with the values of its batch.
struct ReceivedSample {
  std::uint64_t robot_time_us = 0;
  float position_m = 0, velocity_m_s = 0, acceleration_m_s2 = 0;
  float duty = 0;
  float impedance_mv = 0;
  float reference_m = 0;
  protocol::Mode mode = rheonaut_MODE_UNSPECIFIED;
  protocol::SubState sub_state = rheonaut_SUB_STATE_NONE;
  std::optional<float> setpoint_m;
  float disturbance_m = 0;
  float position_sd_m = 0;
  std::uint64_t emergency_id = 0;
  std::uint32_t flags = 0;
  std::uint32_t controller_id = 0;
};

class ReceivedTelemetry {
 public:
  std::optional<protocol::CommandAck> ack_of(std::uint64_t command_id) const;
  // Of this boot, below what is acknowledged.
  std::uint64_t lost_samples() const { return lost_samples_; }
  std::uint64_t durable_next_seq() const { return samples.empty() ? 0 : durable_next_seq_; }

  bool attentive = true;                                   // sends heartbeats
  bool keeps_samples = true;                               // acknowledges as durable
  protocol::Welcome welcome = rheonaut_Welcome_init_zero;  // its durable numbers are filled in

  std::optional<protocol::Hello> hello;      // of the last connection
  std::vector<protocol::RobotFrame> frames;  // all of them, in the order of arrival
  std::vector<protocol::CommandAck> acks;
  std::vector<protocol::Event> events;         // of all boots
  std::vector<protocol::ParameterPage> pages;  // answers
  std::vector<protocol::ParameterPage> table;  // sent after each Welcome, unasked
  std::vector<protocol::Controller> controllers;
  std::map<std::uint64_t, ReceivedSample> samples;  // of this boot, by seq
  std::vector<std::map<std::uint64_t, ReceivedSample>> earlier_boots;

 protected:
  ~ReceivedTelemetry() = default;

  // False when the bytes are no frames.
  bool take(protocol::Bytes bytes);
  protocol::StationFrame welcome_frame() const;
  protocol::StationFrame heartbeat_frame(protocol::StationHeartbeat heartbeat) const;
  // With id, boot and time to live where they are 0.
  protocol::Command completed(protocol::Command command, std::uint64_t boot_id, std::uint64_t robot_time_us);

  protocol::FrameReader reader_;  // of this connection

 private:
  void on_frame(const protocol::RobotFrame& frame);
  void on_hello(const protocol::Hello& frame);
  void on_telemetry(const protocol::Telemetry& batch);
  std::uint64_t durable_next_event_seq() const;

  std::uint64_t boot_id_ = 0;
  std::uint64_t durable_next_seq_ = 0;
  std::size_t earlier_events_ = 0;  // of earlier boots
  std::uint64_t lost_samples_ = 0;
  std::uint64_t next_command_id_ = 1000;
};

}  // namespace sim_robot
