// The station's secrets: making, hashing and comparing them.
//
// A secret is 256 random bits as base64url; it cannot be guessed, so a plain hash (BLAKE2b-256) is stored. A password
// can be guessed, so its Argon2id hash is stored. Comparisons take constant time. Any thread; throws only when random
// numbers or memory are missing (std::runtime_error).
#pragma once

#include <array>
#include <cstddef>
#include <string>

namespace server::runtime {

using SecretHash = std::array<unsigned char, 32>;

std::string random_secret();  // 43 characters
bool is_secret(const std::string& text);
SecretHash hash_of(const std::string& secret);

// In a time that does not depend on where they differ.
bool same(const SecretHash& a, const SecretHash& b);

// The entry whose `hash` is this one, or null. Every entry is compared, whichever it is.
template <class Entries>
auto find_secret(Entries& entries, const SecretHash& hash) -> decltype(&*entries.begin()) {
  decltype(&*entries.begin()) found = nullptr;
  for (auto& entry : entries) {
    if (same(entry.hash, hash)) found = &entry;
  }
  return found;
}

inline constexpr std::size_t kMinPasswordBytes = 8;
inline constexpr std::size_t kMaxPasswordBytes = 200;

// Of Argon2id.
struct PasswordCost {
  unsigned long long passes = 2;
  std::size_t memory_bytes = std::size_t{64} * 1024 * 1024;
};

// With a salt of its own; what it costs stands in it. Computes for a tenth of a second or so.
std::string hash_password(const std::string& password, const PasswordCost& cost);
bool is_password(const std::string& password, const std::string& hash);

}  // namespace server::runtime
