// Dials, shakes hands, and keeps the session.
#include "sim_robot/client/station_socket.hpp"

#include <boost/asio/experimental/awaitable_operators.hpp>
#include <utility>

#include "sim_robot/client/no_throw.hpp"

namespace sim_robot {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

constexpr std::chrono::seconds kHandshakeTimeout{10};

}  // namespace

asio::awaitable<std::string> StationSocket::reach(StationAddress station, std::chrono::milliseconds limit) {
  close();
  socket_ = tcp::socket{socket_.get_executor()};
  const bool reached = co_await dial(socket_, station, limit);
  boost::system::error_code error;
  if (reached) socket_.non_blocking(true, error);
  if (!reached || error) co_return "cannot reach the station";
  wire_ = base::Wire{socket_.native_handle()};
  if (!station.trust) co_return "";
  auto outcome = co_await (shake_hands(std::move(station)) || pause(kHandshakeTimeout));
  const std::string failure = outcome.index() == 0 ? std::get<0>(std::move(outcome)) : "no TLS handshake in time";
  if (!failure.empty()) {
    close();
    session_.reset();
  }
  co_return failure;
}

asio::awaitable<std::string> StationSocket::shake_hands(StationAddress station) {
  wire_.begin_tls(station.trust->context());
  boost::system::error_code no_address;
  asio::ip::make_address(station.host, no_address);
  if (no_address) SSL_set_tlsext_host_name(wire_.tls(), station.host.c_str());
  if (session_) SSL_set_session(wire_.tls(), session_.get());
  for (;;) {
    const base::Wire::Handshake reached = wire_.shake_hands();
    if (!reached.failure.empty()) co_return "the station is not trusted, or speaks no TLS: " + reached.failure;
    if (reached.wait == base::Wire::Wait::none) break;
    const auto what = reached.wait == base::Wire::Wait::readable ? tcp::socket::wait_read : tcp::socket::wait_write;
    const auto [error] = co_await socket_.async_wait(what, kNoThrow);
    if (error) co_return "the station closed the connection in the TLS handshake";
  }
  const std::string objection = station.trust->objection(*wire_.tls());
  co_return objection.empty() ? "" : "the station is not trusted: " + objection;
}

asio::awaitable<bool> StationSocket::wait_readable() {
  if (wire_.has_buffered()) co_return true;
  const auto [error] = co_await socket_.async_wait(tcp::socket::wait_read, kNoThrow);
  co_return !error;
}

bool StationSocket::has_unread() {
  boost::system::error_code ignored;
  return wire_.has_buffered() || socket_.available(ignored) > 0;
}

void StationSocket::cancel() {
  boost::system::error_code ignored;
  socket_.cancel(ignored);
}

void StationSocket::close() {
  forget_wire();
  boost::system::error_code ignored;
  socket_.close(ignored);
}

tcp::socket StationSocket::take() {
  forget_wire();
  tcp::socket taken = std::move(socket_);
  socket_ = tcp::socket{taken.get_executor()};
  return taken;
}

// Its session serves the next handshake.
void StationSocket::forget_wire() {
  if (wire_.is_secure()) session_.reset(SSL_get1_session(wire_.tls()));
  if (session_ && SSL_SESSION_is_resumable(session_.get()) != 1) session_.reset();
  wire_ = base::Wire{-1};
}

}  // namespace sim_robot
