// Calls QEMU by the simulator call of the Tensilica tools (start.S).
#include "robot_fw/lx106/simulator.hpp"

#include <cstring>

extern "C" {
int sim_read(int file, void* to, std::size_t size);
int sim_write(int file, const void* from, std::size_t size);
std::uint32_t sim_ccount();
}

namespace robot_fw::lx106 {

bool read_exactly(void* to, std::size_t size) {
  auto* at = static_cast<std::uint8_t*>(to);
  while (size > 0) {
    const int got = sim_read(kInput, at, size);
    if (got <= 0) return false;
    at += got;
    size -= static_cast<std::size_t>(got);
  }
  return true;
}

void write(int file, const char* text, std::size_t size) {
  while (size > 0) {
    const int put = sim_write(file, text, size);
    if (put <= 0) return;
    text += put;
    size -= static_cast<std::size_t>(put);
  }
}

void write_figure(const char* key, std::uint32_t value) {
  char digits[11];
  std::size_t at = sizeof(digits);
  digits[--at] = '\n';
  do {
    digits[--at] = static_cast<char>('0' + value % 10);
    value /= 10;
  } while (value != 0);
  write(kFigures, key, std::strlen(key));
  write(kFigures, " ", 1);
  write(kFigures, digits + at, sizeof(digits) - at);
}

std::uint32_t instructions() { return sim_ccount() * kInstructionsPerStep; }

}  // namespace robot_fw::lx106
