// Starts a session for each robot that dials in.
#include "server/link/robot_listener.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "server/config/endpoint.hpp"
#include "server/runtime/worker.hpp"

namespace server::link {
namespace asio = boost::asio;

RobotListener::RobotListener(asio::io_context& loop, runtime::Clock& clock, runtime::TaskGroup& tasks,
                             station::Station& station, station::RobotArchive& archive,
                             const asio::ip::tcp::endpoint& endpoint, bool or_any_port, net::PortAccess& access)
    : loop_{loop},
      clock_{clock},
      tasks_{tasks},
      station_{station},
      archive_{archive},
      listener_{loop, clock, endpoint, or_any_port},
      access_{access},
      sockets_{loop, clock} {}

asio::awaitable<void> RobotListener::run() {
  tasks_.spawn("robots' sockets", sockets_.run());
  tasks_.spawn("awaited robots' sockets", sockets_.run_awaited());
  tasks_.spawn("quiet robots' sockets", sockets_.run_quiet());
  auto on_connection = [this](asio::ip::tcp::socket socket) { accept(tls::StreamSocket{std::move(socket)}); };
  const runtime::Counted listening{access_.listening};
  co_await listener_.run(on_connection);
}

void RobotListener::accept(tls::StreamSocket socket) {
  if (access_.tls == nullptr) return serve(make_stream(std::move(socket), sockets_));
  auto slot = access_.limiter.admit(config::host_of(socket.peer()), socket.from_loopback());
  if (!slot) return;
  const std::string which = "robot session of " + socket.peer();
  tasks_.spawn("robot session", contained(tasks_.exceptions(), clock_, runtime::Ended::robot_session, which,
                                          secure_session(std::move(socket), std::move(*slot))));
}

void RobotListener::serve(std::unique_ptr<net::ByteStream> stream) {
  auto slot = access_.limiter.admit(config::host_of(stream->peer()), stream->from_loopback());
  if (!slot) return;
  const std::string which = "robot session of " + stream->peer();
  tasks_.spawn("robot session", contained(tasks_.exceptions(), clock_, runtime::Ended::robot_session, which,
                                          session(std::move(stream), std::move(*slot))));
}

asio::awaitable<void> RobotListener::secure_session(tls::StreamSocket socket,
                                                    std::unique_ptr<net::ConnectionSlot> slot) {
  slot->on_end([&socket] { socket.end(); });
  const tls::TlsHandshakes::Outcome outcome = co_await access_.tls->secure(socket, "robot port");
  if (outcome != tls::TlsHandshakes::Outcome::secure) co_return;
  co_await session(make_stream(std::move(socket), sockets_), std::move(slot));
}

asio::awaitable<void> RobotListener::session(std::unique_ptr<net::ByteStream> stream,
                                             std::unique_ptr<net::ConnectionSlot> slot) {
  const std::string peer = stream->peer();
  RobotSession session{loop_, clock_, std::move(stream), station_, archive_, buffers_};
  slot->on_end([&session] { session.close("it gave way to another connection"); });
  const bool welcome = co_await session.greet();
  if (!welcome) co_return log_unwelcome(peer, session.why_unwelcome());
  slot->becomes(net::ConnectionSlot::busy);
  const std::string which = fmt::format("robot '{}', {}", session.robot_id(), peer);
  co_await contained(tasks_.exceptions(), clock_, runtime::Ended::robot_session, which, session.serve());
}

void RobotListener::log_unwelcome(const std::string& peer, const std::string& why) {
  const auto unsaid = lines_.next(clock_.steady_us());
  if (unsaid) spdlog::warn("robot port: {} was not let in: {}{}", peer, why, runtime::and_before(*unsaid));
}

}  // namespace server::link
