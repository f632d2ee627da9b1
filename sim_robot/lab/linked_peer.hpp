// A minimal station at the far end of an impaired link: it accepts, welcomes, keeps the time and detects silence.
//
// As StationPeer, but it knows of the robot only what has arrived. It follows the protocol: a heartbeat every 200 ms, a
// link lost after 1 s of silence whatever the state of the connection, and commands whose time to live counts from the
// last robot time received plus the time since.
#pragma once

#include "sim_robot/lab/impaired_link.hpp"
#include "sim_robot/lab/received_telemetry.hpp"

namespace sim_robot {

class LinkedPeer : public ReceivedTelemetry {
 public:
  static constexpr std::uint64_t kHeartbeatUs = 200'000;
  static constexpr std::uint64_t kLinkTimeoutUs = 1'000'000;

  explicit LinkedPeer(ImpairedLink& link) : link_(link) {}

  // Each step is one of the link, then serve().
  void step();
  // Reads what has arrived, then sends what is due.
  void serve();
  void run(double for_s);

  // Adds id, boot and time to live where they are 0, sends the command on the open connection, and returns its id. The
  // command is lost with the connection.
  std::uint64_t send(protocol::Command command);

  bool is_connected() const { return connected_; }
  bool link_is_up() const { return welcomed_ && !link_is_lost(); }
  bool link_is_lost() const { return received_at_us_ && link_.now_us() > *received_at_us_ + kLinkTimeoutUs; }
  std::uint64_t silence_us() const { return link_.now_us() - received_at_us_.value_or(0); }
  std::uint64_t robot_time_us() const;  // a lower bound, as the station computes it

 private:
  void accept();
  void read();
  void speak();
  void say(const protocol::StationFrame& frame);
  void flush();

  ImpairedLink& link_;
  int connections_ = 0;
  bool connected_ = false, welcomed_ = false;
  std::optional<std::uint64_t> received_at_us_;
  std::uint64_t heartbeat_at_us_ = 0;  // they acknowledge samples, so they are sent beside commands
  std::vector<std::uint8_t> unsent_;
};

}  // namespace sim_robot
