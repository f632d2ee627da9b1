// The bytes of a connected TCP socket, plain or with TLS over them, as far as they can be read or written without
// waiting. A caller that must wait, waits for the socket and tries again.
//
// OpenSSL reads and writes the socket itself, so a program with TLS ignores SIGPIPE. What a write did not take must be
// what the next one begins with. One thread at a time. The descriptor is the owner's, does not block, and outlives
// this.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <string>

#include "base/tls/openssl.hpp"

namespace base {

class Wire {
 public:
  enum class Wait : std::uint8_t { none, readable, writable };

  // What came of an attempt: done (with its size), what to wait for before the next one, or how the connection ended.
  struct Attempt {
    std::size_t size = 0;
    Wait wait = Wait::none;
    bool is_end = false;  // the peer sends no more
    int error = 0;        // errno of the connection that was lost; 0: none

    bool has_ended() const { return is_end || error != 0; }
  };
  struct Handshake {
    Wait wait = Wait::none;
    std::string failure;  // in OpenSSL's words; empty: none
  };

  explicit Wire(int descriptor) : descriptor_{descriptor} {}  // plain

  bool is_secure() const { return tls_ != nullptr; }
  bool was_resumed() const { return tls_ != nullptr && SSL_session_reused(tls_.get()) == 1; }
  SSL* tls() const { return tls_.get(); }  // null: plain

  // Before the first byte is read or written: TLS as the server or the client that the context (make_tls_context) is
  // of, then shake_hands() until it waits for nothing, which may be on another thread and computes for up to
  // milliseconds.
  void begin_tls(SSL_CTX& context);
  Handshake shake_hands();

  Attempt read(void* into, std::size_t capacity);
  Attempt write(const void* bytes, std::size_t size);
  Attempt peek();             // whether there is a byte: size 1
  bool has_buffered() const;  // bytes that OpenSSL took from the socket, which is then not reported as readable
  void end_sending();         // the peer reads the end after what was written

 private:
  Attempt outcome_of_tls(int result, std::size_t size);
  Attempt outcome_of_tcp(ssize_t size, Wait wait);
  Attempt write_tls(const std::uint8_t* bytes, std::size_t size);

  int descriptor_;
  Openssl<SSL> tls_;
};

}  // namespace base
