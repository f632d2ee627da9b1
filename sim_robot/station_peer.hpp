// The least of a station, in the same process and in virtual time: it welcomes, acknowledges, commands and listens.
//
// What the prediction and the tests drive a robot with; linked_peer has a network in between. The station proper is in
// server/.
#pragma once

#include "sim_robot/heard_robot.hpp"
#include "sim_robot/simulated_robot.hpp"

namespace sim_robot {

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

class StationPeer : public HeardRobot {
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

 private:
  SimulatedRobot& robot_;
  bool connected_ = false;
};

}  // namespace sim_robot
