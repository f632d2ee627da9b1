// Each thread counts for itself, so that what one draws does not depend on how far another is.
#include "tests/goldens/fixed_random.hpp"

#include <sodium.h>

#include <cstdint>
#include <stdexcept>

namespace server {
namespace {

thread_local std::uint64_t drawn = 0;

// splitmix64
std::uint64_t draw() {
  std::uint64_t bits = ++drawn * 0x9e3779b97f4a7c15;
  bits = (bits ^ (bits >> 30U)) * 0xbf58476d1ce4e5b9;
  bits = (bits ^ (bits >> 27U)) * 0x94d049bb133111eb;
  return bits ^ (bits >> 31U);
}

const char* name() { return "fixed"; }

std::uint32_t draw_word() { return static_cast<std::uint32_t>(draw()); }

void fill(void* const into, const std::size_t size) {
  auto* const bytes = static_cast<unsigned char*>(into);
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < size; ++i) {
    bits = i % 8 == 0 ? draw() : bits >> 8U;
    bytes[i] = static_cast<unsigned char>(bits);
  }
}

randombytes_implementation fixed{name, draw_word, nullptr, nullptr, fill, nullptr};

}  // namespace

void fix_random_bytes() {
  if (sodium_init() < 0) throw std::runtime_error{"libsodium does not start"};  // which draws, too, the first time
  drawn = 0;
  randombytes_set_implementation(&fixed);
}

}  // namespace server
