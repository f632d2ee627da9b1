// Faults over HTTP while a simulated robot runs: docs/scenarios.md, The HTTP control.
//
//   GET /faults          what is in force, and the table of what there is
//   POST /faults         one fault as JSON, at once: 201 with its id
//   DELETE /faults/{id}  ends it: 204
// Errors are JSON: status, reason, detail. Limits: header 8 kB (431), body 16 kB (413), one connection at a time, one
// request each, 5 s for it to arrive or be answered, 128 faults that pour glucose.
// SAFETY: it has no password. Only on the loopback unless forced, and never for a page in a browser: requests that name
// another host than an address or localhost, or that come with an Origin, are refused (403).
// Runs on the thread of `loop`, which must outlive it, as must the time line, the robot and its link.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <cstdint>
#include <string>

#include "sim_robot/scenario/fault_timeline.hpp"

namespace sim_robot {

// "127.0.0.1:7400", "[::1]:0", "localhost:7400"; port 0 is any. Throws std::invalid_argument, also for an address
// beyond the loopback unless `anywhere`.
boost::asio::ip::tcp::endpoint parse_faults_address(const std::string& text, bool anywhere = false);

class FaultServer {
 public:
  // Listens from here on; throws when the port is taken.
  FaultServer(boost::asio::io_context& loop, const boost::asio::ip::tcp::endpoint& at, FaultTimeline& faults,
              FaultyRobot robot, std::chrono::milliseconds time = std::chrono::seconds{5});

  // Answers until cancelled.
  boost::asio::awaitable<void> run();

  boost::asio::ip::tcp::endpoint address() const { return acceptor_.local_endpoint(); }

 private:
  boost::asio::awaitable<void> serve(boost::asio::ip::tcp::socket socket);

  boost::asio::ip::tcp::acceptor acceptor_;
  FaultTimeline& faults_;
  FaultyRobot robot_;
  std::chrono::milliseconds time_;  // for a request, and again for its answer
};

}  // namespace sim_robot
