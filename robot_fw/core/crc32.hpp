// CRC-32 (IEEE 802.3, as in zlib), fed piece by piece; numbers count as 4 bytes, little-endian.
#pragma once

#include <cstddef>
#include <cstdint>

namespace robot_fw {

class Crc32 {
 public:
  void add(const void* bytes, std::size_t size);
  void add_word(std::uint32_t word);
  void add_float(float value);

  std::uint32_t value() const { return ~register_; }

 private:
  void add_byte(std::uint8_t byte);

  std::uint32_t register_ = 0xFFFF'FFFFU;
};

}  // namespace robot_fw
