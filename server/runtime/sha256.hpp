// SHA-256 of a text. Any thread.
#pragma once

#include <fmt/format.h>
#include <sodium.h>

#include <string>

namespace server::runtime {

// In lower-case hexadecimal.
inline std::string sha256_of(const std::string& text) {
  unsigned char hash[crypto_hash_sha256_BYTES];
  crypto_hash_sha256(hash, reinterpret_cast<const unsigned char*>(text.data()), text.size());
  std::string hexadecimal;
  for (const unsigned char byte : hash) hexadecimal += fmt::format("{:02x}", byte);
  return hexadecimal;
}

}  // namespace server::runtime
