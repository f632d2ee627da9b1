// The listening port for robots: each connection becomes a task of its own, after its TLS handshake if there is one.
//
// A robot's connection is unauthenticated until its hello has been accepted. ConnectionLimiter says how many may be
// connected and which of them is evicted; never that of a welcomed robot. A refused connection is closed at once. Loop
// thread. Outlives the sessions it started.
#pragma once

#include "server/link/robot_session.hpp"
#include "server/net/listener.hpp"
#include "server/net/poll_set.hpp"
#include "server/net/port_access.hpp"
#include "server/runtime/tasks.hpp"

namespace server::link {

class RobotListener {
 public:
  RobotListener(boost::asio::io_context& loop, runtime::Clock& clock, runtime::TaskGroup& tasks,
                station::Station& station, station::RobotArchive& archive,
                const boost::asio::ip::tcp::endpoint& endpoint, bool or_any_port, net::PortAccess& access);

  boost::asio::awaitable<void> run();

  // Serves an already connected stream, e.g. one end of a MemoryLink.
  void serve(std::unique_ptr<net::ByteStream> stream);

  boost::asio::ip::tcp::endpoint endpoint() const { return listener_.endpoint(); }

 private:
  void accept(tls::StreamSocket socket);
  boost::asio::awaitable<void> secure_session(tls::StreamSocket socket, std::unique_ptr<net::ConnectionSlot> slot);
  boost::asio::awaitable<void> session(std::unique_ptr<net::ByteStream> stream,
                                       std::unique_ptr<net::ConnectionSlot> slot);
  void log_unwelcome(const std::string& peer, const std::string& why);

  boost::asio::io_context& loop_;
  runtime::Clock& clock_;
  runtime::TaskGroup& tasks_;
  station::Station& station_;
  station::RobotArchive& archive_;
  net::Listener listener_;
  net::PortAccess& access_;
  runtime::SparseLines lines_;
  ReadBuffers buffers_{};
  net::PollSet sockets_;  // of the robots
};

}  // namespace server::link
