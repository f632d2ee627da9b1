// Encodes the key and hashes it.
#include "base/tls/public_key.hpp"

#include <array>
#include <stdexcept>

namespace base {

std::string pin_of(const EVP_PKEY& key) {
  unsigned char* der = nullptr;
  const int size = i2d_PUBKEY(&key, &der);
  if (size <= 0) throw std::runtime_error{openssl_error("a public key that cannot be encoded")};
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int digest_size = 0;
  EVP_Digest(der, static_cast<std::size_t>(size), digest.data(), &digest_size, EVP_sha256(), nullptr);
  OPENSSL_free(der);
  constexpr char kHex[] = "0123456789abcdef";
  std::string hex;
  for (unsigned int i = 0; i < digest_size; ++i) {
    hex += kHex[digest[i] / 16U];
    hex += kHex[digest[i] % 16U];
  }
  return hex;
}

}  // namespace base
