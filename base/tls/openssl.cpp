// Sets up contexts, and asks OpenSSL's queue of errors.
#include "base/tls/openssl.hpp"

#include <openssl/err.h>

#include <stdexcept>

namespace base {

Openssl<SSL_CTX> make_tls_context(const SSL_METHOD* side) {
  Openssl<SSL_CTX> context{SSL_CTX_new(side)};
  if (!context || SSL_CTX_set_min_proto_version(context.get(), TLS1_2_VERSION) != 1) {
    throw std::runtime_error{"TLS cannot be set up: " + openssl_error("no reason")};
  }
  SSL_CTX_set_options(context.get(), SSL_OP_IGNORE_UNEXPECTED_EOF);
  SSL_CTX_set_mode(context.get(),
                   SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER | SSL_MODE_RELEASE_BUFFERS);
  return context;
}

std::string openssl_error(const char* otherwise) {
  const unsigned long code = ERR_peek_last_error();
  ERR_clear_error();
  const char* reason = code == 0 ? nullptr : ERR_reason_error_string(code);
  return reason == nullptr ? otherwise : reason;
}

}  // namespace base
