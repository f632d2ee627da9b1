// The pin of a public key: what a client compares that trusts one key and no authority.
#pragma once

#include <string>

#include "base/tls/openssl.hpp"

namespace base {

// SHA-256 of the SubjectPublicKeyInfo in DER, 64 hexadecimal digits in lower case. Throws std::runtime_error.
std::string pin_of(const EVP_PKEY& key);

}  // namespace base
