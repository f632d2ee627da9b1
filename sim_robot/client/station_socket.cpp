// Runs OpenSSL on a socket that does not block.
#include "sim_robot/client/station_socket.hpp"

#include <openssl/err.h>
#include <openssl/x509v3.h>

#include <boost/asio/buffer.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <utility>

#include "sim_robot/client/no_throw.hpp"

namespace sim_robot {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

constexpr std::chrono::seconds kHandshakeTimeout{10};

// What OpenSSL holds against the station, in its words.
std::string reason(const SSL& tls) {
  const long verdict = SSL_get_verify_result(&tls);
  if (verdict != X509_V_OK) return X509_verify_cert_error_string(verdict);
  const char* words = ERR_reason_error_string(ERR_peek_last_error());
  return words == nullptr ? "the connection was lost" : words;
}

// Of a read or a write that did not succeed.
boost::system::error_code error_of(const SSL& tls, int result) {
  const int problem = SSL_get_error(&tls, result);
  ERR_clear_error();
  if (problem == SSL_ERROR_WANT_READ || problem == SSL_ERROR_WANT_WRITE) return asio::error::would_block;
  if (problem == SSL_ERROR_ZERO_RETURN) return asio::error::eof;
  return asio::error::connection_reset;
}

}  // namespace

asio::awaitable<std::string> StationSocket::reach(StationAddress station, std::chrono::milliseconds limit) {
  close();
  socket_ = tcp::socket{socket_.get_executor()};
  const bool reached = co_await dial(socket_, station, limit);
  boost::system::error_code error;
  if (reached) socket_.non_blocking(true, error);
  if (!reached || error) co_return "cannot reach the station";
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
  tls_ = station.trust->connection();
  SSL_set_fd(tls_.get(), socket_.native_handle());
  boost::system::error_code no_address;
  asio::ip::make_address(station.host, no_address);
  if (no_address) SSL_set_tlsext_host_name(tls_.get(), station.host.c_str());
  if (session_) SSL_set_session(tls_.get(), session_.get());
  for (;;) {
    ERR_clear_error();
    const int result = SSL_do_handshake(tls_.get());
    if (result == 1) break;
    const int problem = SSL_get_error(tls_.get(), result);
    if (problem != SSL_ERROR_WANT_READ && problem != SSL_ERROR_WANT_WRITE) {
      co_return "the station is not trusted, or speaks no TLS: " + reason(*tls_);
    }
    const auto what = problem == SSL_ERROR_WANT_READ ? tcp::socket::wait_read : tcp::socket::wait_write;
    const auto [error] = co_await socket_.async_wait(what, kNoThrow);
    if (error) co_return "the station closed the connection in the TLS handshake";
  }
  const std::string objection = station.trust->objection(*tls_);
  co_return objection.empty() ? "" : "the station is not trusted: " + objection;
}

asio::awaitable<bool> StationSocket::wait_readable() {
  if (tls_ && SSL_pending(tls_.get()) > 0) co_return true;
  const auto [error] = co_await socket_.async_wait(tcp::socket::wait_read, kNoThrow);
  co_return !error;
}

std::size_t StationSocket::read_some(std::uint8_t* into, std::size_t capacity, ErrorCode& error) {
  if (!tls_) return socket_.read_some(asio::buffer(into, capacity), error);
  ERR_clear_error();
  std::size_t size = 0;
  const int result = SSL_read_ex(tls_.get(), into, capacity, &size);
  error = result == 1 ? ErrorCode{} : error_of(*tls_, result);
  return size;
}

std::size_t StationSocket::write_some(protocol::Bytes bytes, ErrorCode& error) {
  if (!tls_) return socket_.write_some(asio::buffer(bytes.first, bytes.size), error);
  ERR_clear_error();
  std::size_t size = 0;
  const int result = SSL_write_ex(tls_.get(), bytes.first, bytes.size, &size);
  error = result == 1 ? ErrorCode{} : error_of(*tls_, result);
  return size;
}

bool StationSocket::has_unread() {
  boost::system::error_code ignored;
  return (tls_ && SSL_pending(tls_.get()) > 0) || socket_.available(ignored) > 0;
}

void StationSocket::cancel() {
  boost::system::error_code ignored;
  socket_.cancel(ignored);
}

void StationSocket::close() {
  forget_tls();
  boost::system::error_code ignored;
  socket_.close(ignored);
}

tcp::socket StationSocket::take() {
  forget_tls();
  tcp::socket taken = std::move(socket_);
  socket_ = tcp::socket{taken.get_executor()};
  return taken;
}

// Its session serves the next handshake.
void StationSocket::forget_tls() {
  if (!tls_) return;
  session_.reset(SSL_get1_session(tls_.get()));
  if (session_ && SSL_SESSION_is_resumable(session_.get()) != 1) session_.reset();
  tls_.reset();
}

}  // namespace sim_robot
