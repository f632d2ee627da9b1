// recv and send, or OpenSSL on the same descriptor.
#include "server/tls/wire.hpp"

#include <openssl/err.h>
#include <sys/socket.h>

#include <boost/asio/error.hpp>
#include <cerrno>
#include <new>

namespace server {
namespace asio = boost::asio;

namespace {
constexpr std::size_t kMaxBytesAtOnce = 64 * 1024;  // sealed in one step of the loop, some 50 µs of work
}  // namespace

void Wire::begin_tls(SSL_CTX& context) {
  tls_.reset(SSL_new(&context));
  if (!tls_ || SSL_set_fd(tls_.get(), descriptor_) != 1) throw std::bad_alloc{};
  SSL_set_accept_state(tls_.get());
}

Wire::Handshake Wire::shake_hands() {
  ERR_clear_error();
  const int result = SSL_do_handshake(tls_.get());
  if (result == 1) return {};
  switch (SSL_get_error(tls_.get(), result)) {
    case SSL_ERROR_WANT_READ: return {Wait::readable, {}};
    case SSL_ERROR_WANT_WRITE: return {Wait::writable, {}};
    default: return {Wait::none, openssl_error("the connection was lost")};
  }
}

Wire::Attempt Wire::outcome_of_tls(int result, std::size_t size) {
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

Wire::Attempt Wire::outcome_of_tcp(ssize_t size, Wait wait) {
  if (size > 0) return {static_cast<std::size_t>(size), Wait::none, {}};
  if (size == 0) return {0, Wait::none, asio::error::eof};
  const int problem = errno;
  if (problem == EAGAIN || problem == EINTR) return {0, wait, {}};
  return {0, Wait::none, {problem, boost::system::system_category()}};
}

Wire::Attempt Wire::read(asio::mutable_buffer into) {
  if (into.size() == 0) return {};
  if (!is_secure()) return outcome_of_tcp(::recv(descriptor_, into.data(), into.size(), MSG_DONTWAIT), Wait::readable);
  ERR_clear_error();
  std::size_t size = 0;
  const int result = SSL_read_ex(tls_.get(), into.data(), into.size(), &size);
  return outcome_of_tls(result, size);
}

Wire::Attempt Wire::write(asio::const_buffer bytes) {
  if (bytes.size() == 0) return {};
  if (is_secure()) return write_tls(bytes);
  return outcome_of_tcp(::send(descriptor_, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL), Wait::writable);
}

// Record by record as long as the socket takes them.
Wire::Attempt Wire::write_tls(asio::const_buffer bytes) {
  bytes = asio::buffer(bytes, kMaxBytesAtOnce);
  Attempt total;
  while (bytes.size() > 0) {
    ERR_clear_error();
    std::size_t size = 0;
    const int result = SSL_write_ex(tls_.get(), bytes.data(), bytes.size(), &size);
    const Attempt last = outcome_of_tls(result, size);
    if (last.wait != Wait::none || last.error) return total.size > 0 ? total : last;
    total.size += size;
    bytes += size;
  }
  return total;
}

Wire::Attempt Wire::peek() {
  std::uint8_t byte = 0;
  if (!is_secure()) return outcome_of_tcp(::recv(descriptor_, &byte, 1, MSG_PEEK | MSG_DONTWAIT), Wait::readable);
  ERR_clear_error();
  std::size_t size = 0;
  const int result = SSL_peek_ex(tls_.get(), &byte, 1, &size);
  return outcome_of_tls(result, size);
}

void Wire::end_sending() {
  if (is_secure() && SSL_is_init_finished(tls_.get()) == 1) {
    ERR_clear_error();
    SSL_shutdown(tls_.get());  // says so, without waiting for the answer
    ERR_clear_error();
  }
  ::shutdown(descriptor_, SHUT_WR);
}

}  // namespace server
