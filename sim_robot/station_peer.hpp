// The least of a station, in the same process and in virtual time: it welcomes, acknowledges, commands and listens.
//
// What the prediction and the tests drive a robot with. The station proper is in server/.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "sim_robot/simulated_robot.hpp"

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

// Commands without ids and times; send() adds them.
protocol::Command set_auto(float setpoint_m);
protocol::Command set_manual();
protocol::Command set_setpoint(float setpoint_m);
protocol::Command set_duty(float duty, std::uint32_t lease_ms = 0);
protocol::Command renew_lease();
protocol::Command emergency_stop();
protocol::Command clear_emergency(std::uint64_t emergency_id);
protocol::Command inject_disturbance(float disturbance_m);
protocol::Command zero_position();
protocol::Command ping();
protocol::Command set_controller(const protocol::Controller& controller);
protocol::Command restore_controller();
protocol::Command set_parameter(const char* name, float value);
protocol::Command get_parameters(std::uint32_t first_index);

class StationPeer {
 public:
  explicit StationPeer(SimulatedRobot& robot) : robot_(robot) {}

  // Opens a connection, takes the Hello and answers it; what is stored already is what was heard.
  void connect();
  void disconnect();

  // Ticks: each is a step of the robot, then reading what it sends, then, when `attentive`, a heartbeat that
  // acknowledges it.
  void run(int ticks);
  void step();
  // Everything the robot has to send now.
  void listen();

  // Adds id, boot and life where they are 0, sends, and returns the id.
  std::uint64_t send(protocol::Command command);
  // False when the robot wants the connection closed.
  bool send(const protocol::StationFrame& frame);
  bool send_heartbeat(protocol::StationHeartbeat heartbeat);
  std::optional<protocol::CommandAck> ack_of(std::uint64_t command_id) const;

  bool attentive = true;                                   // sends signs of life
  bool keeps_samples = true;                               // acknowledges as durable
  protocol::Welcome welcome = rheonaut_Welcome_init_zero;  // its durable numbers are filled in by connect()

  std::optional<protocol::Hello> hello;
  std::vector<protocol::RobotFrame> frames;  // all of them, in the order of arrival
  std::vector<protocol::CommandAck> acks;
  std::vector<protocol::Event> events;
  std::vector<protocol::ParameterPage> pages;
  std::vector<protocol::Controller> controllers;
  std::map<std::uint64_t, ReceivedSample> samples;  // by seq

 private:
  void on_frame(const protocol::RobotFrame& frame);
  std::uint64_t durable_next_seq() const;
  std::uint64_t durable_next_event_seq() const;

  SimulatedRobot& robot_;
  bool connected_ = false;
  std::uint64_t next_command_id_ = 1000;
};

}  // namespace sim_robot
