// Runs OpenSSL on a socket that does not block.
#include "server/net/stream_socket.hpp"

#include <openssl/err.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <boost/asio/error.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <cerrno>
#include <new>

namespace server {
namespace asio = boost::asio;
using asio::ip::tcp;

namespace {

constexpr std::size_t kRecordBytes = 16 * 1024;
constexpr std::size_t kMaxBytesAtOnce = 64 * 1024;  // sealed in one step of the loop, some 50 µs of work

}  // namespace

StreamSocket::StreamSocket(tcp::socket socket) : socket_{std::move(socket)} {
  boost::system::error_code ignored;  // a peer that is gone already shows at the first read
  socket_.set_option(tcp::no_delay{true}, ignored);
  socket_.non_blocking(true, ignored);
  const auto remote = socket_.remote_endpoint(ignored);
  peer_ = remote.address().to_string() + ":" + std::to_string(remote.port());
  from_loopback_ = remote.address().is_loopback();
}

void StreamSocket::begin_tls(SSL_CTX& context) {
  tls_.reset(SSL_new(&context));
  if (!tls_ || SSL_set_fd(tls_.get(), socket_.native_handle()) != 1) throw std::bad_alloc{};
  SSL_set_accept_state(tls_.get());
}

StreamSocket::Handshake StreamSocket::shake_hands_now() {
  ERR_clear_error();
  const int result = SSL_do_handshake(tls_.get());
  if (result == 1) return {};
  switch (SSL_get_error(tls_.get(), result)) {
    case SSL_ERROR_WANT_READ: return {Wait::readable, {}};
    case SSL_ERROR_WANT_WRITE: return {Wait::writable, {}};
    default: return {Wait::none, openssl_error("the connection was lost")};
  }
}

StreamSocket::Attempt StreamSocket::outcome(int result, std::size_t size) {
  if (result == 1) return {size, Wait::none, {}};
  const int problem = SSL_get_error(tls_.get(), result);
  ERR_clear_error();
  switch (problem) {
    case SSL_ERROR_WANT_READ: return {0, Wait::readable, {}};
    case SSL_ERROR_WANT_WRITE: return {0, Wait::writable, {}};
    case SSL_ERROR_ZERO_RETURN: return {0, Wait::none, asio::error::eof};
    default: return {0, Wait::none, asio::error::connection_reset};
  }
}

StreamSocket::Attempt StreamSocket::read_tls(asio::mutable_buffer into) {
  ERR_clear_error();
  std::size_t size = 0;
  return outcome(SSL_read_ex(tls_.get(), into.data(), into.size(), &size), size);
}

// Record by record as long as the socket takes them.
StreamSocket::Attempt StreamSocket::write_tls(asio::const_buffer bytes) {
  bytes = asio::buffer(bytes, kMaxBytesAtOnce);
  Attempt total;
  while (bytes.size() > 0) {
    ERR_clear_error();
    std::size_t size = 0;
    const Attempt last = outcome(SSL_write_ex(tls_.get(), bytes.data(), bytes.size(), &size), size);
    if (last.wait != Wait::none || last.error) return total.size > 0 ? total : last;
    total.size += size;
    bytes += size;
  }
  return total;
}

std::size_t StreamSocket::write_now(asio::const_buffer bytes) {
  if (is_secure()) return write_tls(bytes).size;
  boost::system::error_code ignored;  // would block, or the stream has ended: the next write tells which
  return socket_.non_blocking() ? socket_.write_some(bytes, ignored) : 0;
}

asio::mutable_buffer StreamSocket::scratch() {
  static std::array<std::uint8_t, kRecordBytes> bytes;  // of the loop, which copies into it and seals in one step
  return asio::buffer(bytes);
}

asio::awaitable<void> StreamSocket::peer_gone() {
  for (;;) {
    co_await socket_.async_wait(tcp::socket::wait_read, asio::use_awaitable);
    std::uint8_t byte = 0;
    bool has_bytes = false, has_ended = false;
    if (is_secure()) {
      ERR_clear_error();
      std::size_t size = 0;
      const Attempt ahead = outcome(SSL_peek_ex(tls_.get(), &byte, 1, &size), size);
      has_bytes = ahead.size > 0;
      has_ended = static_cast<bool>(ahead.error);
    } else {
      const ssize_t size = ::recv(socket_.native_handle(), &byte, 1, MSG_PEEK | MSG_DONTWAIT);
      has_bytes = size > 0;
      has_ended = size == 0 || (size < 0 && errno != EAGAIN && errno != EINTR);
    }
    if (has_bytes) co_await socket_.async_wait(tcp::socket::wait_error, asio::use_awaitable);
    if (has_bytes || has_ended) co_return;
  }
}

void StreamSocket::end_sending() {
  if (is_secure() && SSL_is_init_finished(tls_.get()) == 1) {
    ERR_clear_error();
    SSL_shutdown(tls_.get());  // says so, without waiting for the answer
    ERR_clear_error();
  }
  boost::system::error_code ignored;
  socket_.shutdown(tcp::socket::shutdown_send, ignored);
}

void StreamSocket::end() {
  boost::system::error_code ignored;
  socket_.shutdown(tcp::socket::shutdown_both, ignored);
  socket_.cancel(ignored);
}

}  // namespace server
