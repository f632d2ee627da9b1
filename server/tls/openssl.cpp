// Asks OpenSSL's queue of errors.
#include "server/tls/openssl.hpp"

#include <openssl/err.h>

namespace server {

std::string openssl_error(const char* otherwise) {
  const unsigned long code = ERR_peek_last_error();
  ERR_clear_error();
  const char* reason = code == 0 ? nullptr : ERR_reason_error_string(code);
  return reason == nullptr ? otherwise : reason;
}

}  // namespace server
