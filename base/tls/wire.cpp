// recv and send, or OpenSSL on the same descriptor.
#include "base/tls/wire.hpp"

#include <openssl/err.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <new>

namespace base {
namespace {

constexpr std::size_t kMaxBytesAtOnce = 64 * 1024;  // sealed in one step of the loop, some 50 µs of work

// What the side that was refused holds against the certificate, or else the last error.
std::string failure_of(const SSL& tls) {
  const long verdict = SSL_get_verify_result(&tls);
  const std::string error = openssl_error("the connection was lost");
  return verdict == X509_V_OK ? error : X509_verify_cert_error_string(verdict);
}

}  // namespace

void Wire::begin_tls(SSL_CTX& context) {
  tls_.reset(SSL_new(&context));
  if (!tls_ || SSL_set_fd(tls_.get(), descriptor_) != 1) throw std::bad_alloc{};
  if (SSL_is_server(tls_.get()) == 1) {
    SSL_set_accept_state(tls_.get());
  } else {
    SSL_set_connect_state(tls_.get());
  }
}

Wire::Handshake Wire::shake_hands() {
  ERR_clear_error();
  const int result = SSL_do_handshake(tls_.get());
  if (result == 1) return {};
  switch (SSL_get_error(tls_.get(), result)) {
    case SSL_ERROR_WANT_READ: return {Wait::readable, {}};
    case SSL_ERROR_WANT_WRITE: return {Wait::writable, {}};
    default: return {Wait::none, failure_of(*tls_)};
  }
}

Wire::Attempt Wire::outcome_of_tls(int result, std::size_t size) {
  if (result == 1) return {.size = size};
  const int problem = SSL_get_error(tls_.get(), result);
  ERR_clear_error();
  switch (problem) {
    case SSL_ERROR_WANT_READ: return {.wait = Wait::readable};
    case SSL_ERROR_WANT_WRITE: return {.wait = Wait::writable};
    case SSL_ERROR_ZERO_RETURN: return {.is_end = true};
    default: return {.error = ECONNRESET};
  }
}

Wire::Attempt Wire::outcome_of_tcp(ssize_t size, Wait wait) {
  if (size > 0) return {.size = static_cast<std::size_t>(size)};
  if (size == 0) return {.is_end = true};
  const int problem = errno;
  if (problem == EAGAIN || problem == EINTR) return {.wait = wait};
  return {.error = problem};
}

Wire::Attempt Wire::read(void* into, std::size_t capacity) {
  if (capacity == 0) return {};
  if (!is_secure()) return outcome_of_tcp(::recv(descriptor_, into, capacity, MSG_DONTWAIT), Wait::readable);
  ERR_clear_error();
  std::size_t size = 0;
  const int result = SSL_read_ex(tls_.get(), into, capacity, &size);
  return outcome_of_tls(result, size);
}

Wire::Attempt Wire::write(const void* bytes, std::size_t size) {
  if (size == 0) return {};
  if (is_secure()) return write_tls(static_cast<const std::uint8_t*>(bytes), std::min(size, kMaxBytesAtOnce));
  return outcome_of_tcp(::send(descriptor_, bytes, size, MSG_DONTWAIT | MSG_NOSIGNAL), Wait::writable);
}

// Record by record as long as the socket takes them.
Wire::Attempt Wire::write_tls(const std::uint8_t* bytes, std::size_t size) {
  Attempt total;
  while (total.size < size) {
    ERR_clear_error();
    std::size_t written = 0;
    const int result = SSL_write_ex(tls_.get(), bytes + total.size, size - total.size, &written);
    const Attempt last = outcome_of_tls(result, written);
    if (last.wait != Wait::none || last.has_ended()) return total.size > 0 ? total : last;
    total.size += last.size;
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

bool Wire::has_buffered() const { return is_secure() && SSL_pending(tls_.get()) > 0; }

void Wire::end_sending() {
  if (is_secure() && SSL_is_init_finished(tls_.get()) == 1) {
    ERR_clear_error();
    SSL_shutdown(tls_.get());  // says so, without waiting for the answer
    ERR_clear_error();
  }
  ::shutdown(descriptor_, SHUT_WR);
}

}  // namespace base
