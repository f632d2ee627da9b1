// Speaks the station's half of the protocol.
#include "sim_robot/lab/station_peer.hpp"

#include <array>

namespace sim_robot {

void StationPeer::connect() {
  robot_.link_opened(robot_.robot_time_us());
  connected_ = true;
  hello.reset();
  reader_.reset();
  listen();
  send(welcome_frame());
}

void StationPeer::disconnect() {
  robot_.link_closed(robot_.robot_time_us());
  connected_ = false;
}

void StationPeer::run(int ticks) {
  for (int i = 0; i < ticks; ++i) step();
}

void StationPeer::step() {
  robot_.step();
  if (!connected_) return;
  listen();
  if (attentive) send_heartbeat(rheonaut_StationHeartbeat_init_zero);
}

void StationPeer::listen() {
  std::array<std::uint8_t, protocol::kMaxFramedBytes> buffer;
  while (const std::size_t size = robot_.transmit(buffer.data(), buffer.size(), robot_.robot_time_us())) {
    if (!take({buffer.data(), size})) return;
  }
}

std::uint64_t StationPeer::send(protocol::Command command) {
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_command_tag;
  frame.body.command = completed(command, robot_.config().boot_id, robot_.robot_time_us());
  send(frame);
  return frame.body.command.command_id;
}

bool StationPeer::send(const protocol::StationFrame& frame) {
  std::array<std::uint8_t, protocol::kMaxFramedBytes> buffer;
  const std::size_t size = protocol::write_frame(frame, buffer.data(), buffer.size());
  return robot_.receive({buffer.data(), size}, robot_.robot_time_us());
}

bool StationPeer::send_heartbeat(protocol::StationHeartbeat heartbeat) { return send(heartbeat_frame(heartbeat)); }

}  // namespace sim_robot
