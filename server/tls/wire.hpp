// The bytes of a connected TCP socket, plain or with TLS over them, as far as they can be read or written without
// waiting. Who must wait, waits for the socket and tries again.
//
// OpenSSL reads and writes the socket itself. What a write did not take must be what the next one begins with. One
// thread at a time. The descriptor is the owner's, does not block, and outlives this.
#pragma once

#include <boost/asio/buffer.hpp>
#include <boost/system/error_code.hpp>
#include <cstdint>
#include <string>

#include "server/tls/openssl.hpp"

namespace server {

class Wire {
 public:
  enum class Wait : std::uint8_t { none, readable, writable };

  // What came of an attempt: done (with its size or its error), or what to wait for before the next one.
  struct Attempt {
    std::size_t size = 0;
    Wait wait = Wait::none;
    boost::system::error_code error;
  };
  struct Handshake {
    Wait wait = Wait::none;
    std::string failure;  // in OpenSSL's words; empty: none
  };

  explicit Wire(int descriptor) : descriptor_{descriptor} {}  // plain

  bool is_secure() const { return tls_ != nullptr; }
  bool was_resumed() const { return tls_ != nullptr && SSL_session_reused(tls_.get()) == 1; }

  // Before the first byte is read or written: TLS as the server, then shake_hands() until it waits for nothing, which
  // may be on another thread and computes for up to milliseconds.
  void begin_tls(SSL_CTX& context);
  Handshake shake_hands();

  Attempt read(boost::asio::mutable_buffer into);
  Attempt write(boost::asio::const_buffer bytes);
  Attempt peek();      // whether there is a byte: size 1
  void end_sending();  // the peer reads the end after what was written

 private:
  Attempt outcome_of_tls(int result, std::size_t size);
  Attempt outcome_of_tcp(ssize_t size, Wait wait);
  Attempt write_tls(boost::asio::const_buffer bytes);

  int descriptor_;
  Openssl<SSL> tls_;
};

}  // namespace server
