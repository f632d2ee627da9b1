// Accepts, reads, welcomes, and keeps quiet or not.
#include "sim_robot/lab/linked_peer.hpp"

#include <array>
#include <cmath>

namespace sim_robot {

void LinkedPeer::run(double for_s) {
  const auto steps = std::lround(1e6 * for_s / static_cast<double>(ImpairedLink::kStepUs));
  for (long i = 0; i < steps; ++i) step();
}

void LinkedPeer::step() {
  link_.step();
  serve();
}

void LinkedPeer::serve() {
  if (link_.connections() != connections_) accept();
  if (connected_) read();
  if (connected_) speak();
}

void LinkedPeer::accept() {
  connections_ = link_.connections();
  connected_ = true;
  welcomed_ = false;
  received_at_us_ = link_.now_us();
  unsent_.clear();
  reader_.reset();
  hello.reset();
}

void LinkedPeer::read() {
  std::array<std::uint8_t, 1460> bytes;
  while (const std::size_t size = link_.receive(bytes.data(), bytes.size())) {
    received_at_us_ = link_.now_us();
    const bool good = take({bytes.data(), size});
    if (!good) link_.close();
  }
  if (link_is_lost()) link_.close();
  connected_ = link_.is_open();
  if (hello && connected_ && !welcomed_) {
    welcomed_ = true;
    heartbeat_at_us_ = link_.now_us();
    say(welcome_frame());
  }
}

void LinkedPeer::speak() {
  if (welcomed_ && attentive && link_.now_us() >= heartbeat_at_us_ + kHeartbeatUs) {
    heartbeat_at_us_ = link_.now_us();
    say(heartbeat_frame(rheonaut_StationHeartbeat_init_zero));
  }
  flush();
}

std::uint64_t LinkedPeer::send(protocol::Command command) {
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_command_tag;
  frame.body.command = completed(command, hello ? hello->boot_id : 0, robot_time_us());
  if (connected_) say(frame);
  return frame.body.command.command_id;
}

std::uint64_t LinkedPeer::robot_time_us() const {
  return frames.empty() ? 0 : frames.back().robot_time_us + silence_us();
}

void LinkedPeer::say(const protocol::StationFrame& frame) {
  std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes;
  const std::size_t size = protocol::write_frame(frame, bytes.data(), bytes.size());
  unsent_.insert(unsent_.end(), bytes.data(), bytes.data() + size);
  flush();
}

void LinkedPeer::flush() {
  const std::size_t taken = link_.send({unsent_.data(), unsent_.size()});
  unsent_.erase(unsent_.begin(), unsent_.begin() + static_cast<std::ptrdiff_t>(taken));
}

}  // namespace sim_robot
