// A minimal station in the same process and in virtual time: it welcomes, acknowledges, commands and receives.
//
// The prediction and the tests drive a robot with it; linked_peer has a network in between. The real station is in
// server/.
#pragma once

#include "sim_robot/lab/received_telemetry.hpp"
#include "sim_robot/lab/station_commands.hpp"
#include "sim_robot/robot/simulated_robot.hpp"

namespace sim_robot {

class StationPeer : public ReceivedTelemetry {
 public:
  explicit StationPeer(SimulatedRobot& robot) : robot_(robot) {}

  // Opens a connection, reads the Hello and answers it; what was received counts as stored.
  void connect();
  void disconnect();

  // Ticks: each is a step of the robot, then reading what it sends, then, when `attentive`, a heartbeat that
  // acknowledges it.
  void run(int ticks);
  void step();
  // Reads everything that the robot has to send now.
  void listen();

  // Adds id, boot and time to live where they are 0, sends the command, and returns its id.
  std::uint64_t send(protocol::Command command);
  // False when the robot wants the connection closed.
  bool send(const protocol::StationFrame& frame);
  bool send_heartbeat(protocol::StationHeartbeat heartbeat);

 private:
  SimulatedRobot& robot_;
  bool connected_ = false;
};

}  // namespace sim_robot
