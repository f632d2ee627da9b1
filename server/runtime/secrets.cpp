// libsodium, by its names of today.
#include "server/runtime/secrets.hpp"

#include <sodium.h>

#include <stdexcept>

namespace server::runtime {
namespace {

constexpr auto kVariant = sodium_base64_VARIANT_URLSAFE_NO_PADDING;

void start_sodium() {
  if (sodium_init() < 0) throw std::runtime_error{"libsodium cannot start: no source of random numbers"};
}

}  // namespace

std::string random_secret() {
  start_sodium();
  SecretHash bytes;
  randombytes_buf(bytes.data(), bytes.size());
  char text[sodium_base64_ENCODED_LEN(sizeof bytes, kVariant)];
  sodium_bin2base64(text, sizeof text, bytes.data(), bytes.size(), kVariant);
  return text;
}

bool is_secret(const std::string& text) {
  SecretHash bytes;
  std::size_t size = 0;
  return sodium_base642bin(bytes.data(), bytes.size(), text.data(), text.size(), nullptr, &size, nullptr, kVariant) ==
             0 &&
         size == bytes.size();
}

SecretHash hash_of(const std::string& secret) {
  SecretHash hash{};
  crypto_generichash(hash.data(), hash.size(), reinterpret_cast<const unsigned char*>(secret.data()), secret.size(),
                     nullptr, 0);
  return hash;
}

bool same(const SecretHash& a, const SecretHash& b) { return sodium_memcmp(a.data(), b.data(), a.size()) == 0; }

std::string hash_password(const std::string& password, const PasswordCost& cost) {
  start_sodium();
  char hash[crypto_pwhash_STRBYTES];
  if (crypto_pwhash_str(hash, password.data(), password.size(), cost.passes, cost.memory_bytes) != 0) {
    throw std::runtime_error{"no memory to hash a password"};
  }
  return hash;
}

bool is_password(const std::string& password, const std::string& hash) {
  start_sodium();
  return crypto_pwhash_str_verify(hash.c_str(), password.data(), password.size()) == 0;
}

}  // namespace server::runtime
