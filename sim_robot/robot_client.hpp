// Runs a simulated robot in real time and connects it to a station over TCP.
//
// True time is the host's steady clock since run() began, on time or late, in a tick or between two. Ticks are due at
// multiples of the period; late ones run before any byte is handed to the robot, so its time never goes back. After a
// stall (the process was stopped, the machine busy) the missed ones are skipped and counted.
// A tick never waits for the network: what the socket does not take at once stays in the one frame under way, and the
// robot keeps the rest. The connection is dialled again for ever, at most 1 s apart. With a handshake, as TLS on the
// robot's board, it dials only at rest, and nothing ticks until the handshake is over.
// Owns robot and socket. One thread: that of `loop`, which must outlive the client.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <optional>
#include <random>
#include <string>

#include "sim_robot/fault_timeline.hpp"
#include "sim_robot/robot_life.hpp"

namespace sim_robot {

struct StationAddress {
  std::string host;
  std::string port;
};
// "host:port" or "[v6]:port"; throws std::invalid_argument that names the option.
StationAddress parse_station_address(const std::string& text, const std::string& option = "--station",
                                     int lowest_port = 1);

// What people are told about the link, one line each.
using LinkLog = std::function<void(const std::string& line)>;

class RobotClient {
 public:
  RobotClient(boost::asio::io_context& loop, SimulatedRobotConfig config, StationAddress station, LinkLog log,
              std::chrono::milliseconds handshake = {}, std::vector<TimedFault> faults = {});

  // Ticks and connects until cancelled. Never returns otherwise.
  boost::asio::awaitable<void> run();

  // The connection is left without an end, and reset when the robot is back.
  void reboot(const Reboot& reboot);

  const SimulatedRobot& robot() const { return life_.robot(); }
  // For who injects faults while it runs, on the same thread.
  SimulatedRobot& robot() { return life_.robot(); }
  FaultTimeline& faults() { return faults_; }
  FaultyRobot faulty() { return {life_, nullptr}; }
  RobotLife& life() { return life_; }  // for its clock

 private:
  using Clock = std::chrono::steady_clock;

  boost::asio::awaitable<void> tick();
  boost::asio::awaitable<void> stay_connected();
  boost::asio::awaitable<bool> dial();
  boost::asio::awaitable<bool> shake_hands();
  boost::asio::awaitable<void> serve();
  void flush();
  void close_if_silent();
  void close_connection();
  std::uint64_t catch_up();
  void say_how_it_ended();
  void say(const std::string& line);

  bool may_dial() const;
  void forget_connection();

  RobotLife life_;
  StationAddress station_;
  LinkLog log_;
  std::chrono::milliseconds handshake_;
  FaultTimeline faults_;
  boost::asio::ip::tcp::socket socket_;
  std::optional<boost::asio::ip::tcp::socket> forgotten_;  // of the boot before
  boost::asio::steady_timer tick_timer_;
  bool connected_ = false;
  bool was_up_ = false;  // welcomed on this connection
  std::string last_line_;

  Clock::time_point booted_at_;                                  // true time 0
  std::array<std::uint8_t, protocol::kMaxFramedBytes> frame_{};  // under way
  std::size_t frame_size_ = 0, frame_sent_ = 0;
  std::minstd_rand jitter_{std::random_device{}()};
};

}  // namespace sim_robot
