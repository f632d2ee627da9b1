// The least of a station over TCP, for many robots: it welcomes, keeps account of samples, and acknowledges them.
//
// One loop, no disk. A hole that a robot can still fill is asked for again; what it no longer holds counts as missing.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>

#include "protocol/frame.hpp"

namespace sim_robot {

// What came of one boot.
struct StoredBoot {
  std::string robot_id;
  std::map<std::uint64_t, std::uint64_t> runs;  // of samples: first → end
  std::uint64_t next_seq = 0;                   // every sample below is stored or missing
  std::uint64_t missing = 0;
  std::uint64_t samples = 0;  // distinct ones
  std::uint64_t repeated = 0;
  std::uint64_t backfill_frames = 0;
  std::uint64_t connections = 0;
  std::uint64_t refused_commands = 0;  // acks that say rejected

  void store(std::uint64_t first_seq, std::uint64_t end_seq, std::uint64_t oldest_seq);

 private:
  void pass_over_gaps(std::uint64_t oldest_seq);
};

class TelemetrySink {
 public:
  explicit TelemetrySink(boost::asio::io_context& loop, std::uint16_t port = 0);
  ~TelemetrySink();

  std::uint16_t port() const { return reserved_.local_endpoint().port(); }
  // Goes away with all connections, and comes back on the same port, which no other program gets meanwhile.
  void close();
  void open();

  // To every robot that is connected.
  void send_all(const protocol::StationFrame& frame);

  const std::map<std::uint64_t, StoredBoot>& boots() const { return boots_; }
  std::size_t connections() const { return sessions_.size(); }
  std::uint64_t frames() const { return frames_; }
  std::uint64_t samples() const;

  std::set<std::string> refused;              // robots that are not welcome
  std::chrono::milliseconds acks_every{200};  // to each robot
  std::uint32_t link_timeout_ms = 0;          // in its welcomes; 0: the robot's default
  bool acknowledges = true;                   // otherwise its welcomes and heartbeats say that nothing is durable
  std::function<void(const protocol::RobotFrame&, const std::string& robot_id)> on_frame;

 private:
  struct Session;
  static void bind(boost::asio::ip::tcp::acceptor& acceptor, std::uint16_t port);
  void accept();
  void read(const std::shared_ptr<Session>& session);
  bool take(Session& session, std::size_t size);
  bool take_frame(Session& session, const protocol::RobotFrame& frame);
  bool welcome(Session& session, const protocol::Hello& hello);
  void acknowledge(Session& session);
  static void send(Session& session, const protocol::StationFrame& frame);

  boost::asio::ip::tcp::acceptor reserved_;  // has the port, and never listens
  boost::asio::ip::tcp::acceptor acceptor_;
  std::set<std::shared_ptr<Session>> sessions_;
  std::map<std::uint64_t, StoredBoot> boots_;
  std::uint64_t frames_ = 0;
};

}  // namespace sim_robot
