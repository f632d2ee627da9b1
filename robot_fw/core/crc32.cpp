// Computes the checksum bit by bit: it is needed seldom, and a table would cost 1 kB.
#include "robot_fw/core/crc32.hpp"

#include <cstring>

namespace robot_fw {

void Crc32::add_byte(std::uint8_t byte) {
  register_ ^= byte;
  for (int bit = 0; bit < 8; ++bit) register_ = (register_ >> 1) ^ ((register_ & 1U) != 0 ? 0xEDB8'8320U : 0);
}

void Crc32::add(const void* bytes, std::size_t size) {
  const auto* at = static_cast<const std::uint8_t*>(bytes);
  for (std::size_t i = 0; i < size; ++i) add_byte(at[i]);
}

void Crc32::add_word(std::uint32_t word) {
  for (unsigned shift = 0; shift < 32; shift += 8) add_byte(static_cast<std::uint8_t>(word >> shift));
}

void Crc32::add_float(float value) {
  std::uint32_t word = 0;
  static_assert(sizeof(word) == sizeof(value), "a float has 4 bytes");
  std::memcpy(&word, &value, sizeof(word));
  add_word(word);
}

}  // namespace robot_fw
