// Reads tests/data/golden_frames.txt; the format is described at its top.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace protocol {

struct GoldenFrame {
  std::string name;
  bool from_robot = false;
  std::vector<std::uint8_t> bytes;  // with the length prefix

  // Without the length prefix.
  std::vector<std::uint8_t> payload() const {
    const std::ptrdiff_t prefix = (bytes.at(0) & 0x80) != 0 ? 2 : 1;
    return {bytes.begin() + prefix, bytes.end()};
  }
};

// All frames in the order of the file; throws std::runtime_error when there is no file or a line is not understood.
std::vector<GoldenFrame> read_golden_frames();

}  // namespace protocol
