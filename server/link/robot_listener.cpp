// Starts a session for each robot that dials in.
#include "server/link/robot_listener.hpp"

#include <spdlog/spdlog.h>

#include <boost/asio/error.hpp>
#include <boost/system/system_error.hpp>
#include <optional>

#include "server/counted.hpp"

namespace server {
namespace asio = boost::asio;

RobotListener::RobotListener(asio::io_context& loop, Clock& clock, TaskGroup& tasks, Station& station,
                             RobotArchive& archive, const asio::ip::tcp::endpoint& endpoint, bool or_any_port,
                             TlsGate* tls)
    : loop_{loop},
      clock_{clock},
      tasks_{tasks},
      station_{station},
      archive_{archive},
      listener_{loop, clock, endpoint, or_any_port},
      tls_{tls} {}

asio::awaitable<void> RobotListener::run() {
  auto on_connection = [this](asio::ip::tcp::socket socket) { accept(StreamSocket{std::move(socket)}); };
  co_await listener_.run(on_connection);
}

void RobotListener::accept(StreamSocket socket) {
  if (tls_ == nullptr) return serve(make_stream(std::move(socket)));
  if (!is_full(socket.peer())) tasks_.spawn("robot session", secure_session(std::move(socket)));
}

void RobotListener::serve(std::unique_ptr<ByteStream> stream) {
  if (!is_full(stream->peer())) tasks_.spawn("robot session", session(std::move(stream)));
}

bool RobotListener::is_full(const std::string& peer) const {
  if (connections_ < kMaxConnections && greetings_ < kMaxGreetings) return false;
  spdlog::warn("robot port: {} closed: {} connections are open, {} of them without a hello", peer, connections_,
               greetings_);
  return true;
}

asio::awaitable<void> RobotListener::secure_session(StreamSocket socket) {
  std::optional<Counted<int>> connection{connections_}, greeting{greetings_};
  const TlsGate::Outcome outcome = co_await tls_->secure(socket, "robot port");
  if (outcome != TlsGate::Outcome::secure) co_return;
  connection.reset();  // session() counts it
  greeting.reset();
  co_await session(make_stream(std::move(socket)));
}

asio::awaitable<void> RobotListener::session(std::unique_ptr<ByteStream> stream) {
  const std::string peer = stream->peer();
  const Counted connection{connections_};
  std::optional<Counted<int>> greeting{greetings_};
  RobotSession session{loop_, clock_, std::move(stream), station_, archive_};
  try {
    const bool welcome = co_await session.greet();
    greeting.reset();
    if (welcome) co_await session.serve();
  } catch (const boost::system::system_error& error) {
    if (error.code() != asio::error::operation_aborted) spdlog::warn("robot session {}: {}", peer, error.what());
  } catch (const std::exception& error) {
    spdlog::error("robot session {}: {}", peer, error.what());
  }
}

}  // namespace server
