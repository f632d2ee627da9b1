// The port where robots dial in: each connection becomes a task of its own, behind its TLS handshake if there is one.
//
// Loop thread. Outlives the sessions it started.
#pragma once

#include "server/link/robot_session.hpp"
#include "server/net/listener.hpp"
#include "server/net/tls_gate.hpp"
#include "server/tasks.hpp"

namespace server {

class RobotListener {
 public:
  static constexpr int kMaxConnections = 8192;  // a further one is closed at once
  static constexpr int kMaxGreetings = 2048;    // of them, how many may not have been welcomed yet

  RobotListener(boost::asio::io_context& loop, Clock& clock, TaskGroup& tasks, Station& station, RobotArchive& archive,
                const boost::asio::ip::tcp::endpoint& endpoint, bool or_any_port, TlsGate* tls = nullptr);

  boost::asio::awaitable<void> run();

  // Serves an already connected stream, e.g. one end of a MemoryLink.
  void serve(std::unique_ptr<ByteStream> stream);

  boost::asio::ip::tcp::endpoint endpoint() const { return listener_.endpoint(); }

 private:
  bool is_full(const std::string& peer) const;
  void accept(StreamSocket socket);
  boost::asio::awaitable<void> secure_session(StreamSocket socket);
  boost::asio::awaitable<void> session(std::unique_ptr<ByteStream> stream);

  boost::asio::io_context& loop_;
  Clock& clock_;
  TaskGroup& tasks_;
  Station& station_;
  RobotArchive& archive_;
  Listener listener_;
  TlsGate* tls_;  // null: plain TCP
  int connections_ = 0;
  int greetings_ = 0;
};

}  // namespace server
