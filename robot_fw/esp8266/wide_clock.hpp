// Microseconds since boot in 64 bits, from the chip's counter of 32, which wraps after 71 minutes.
#pragma once

#include <Arduino.h>

#include <cstdint>

namespace robot_fw::esp8266 {

class WideClock {
 public:
  // To be asked more often than once in 71 minutes, and never from an interrupt.
  std::uint64_t now_us() {
    const std::uint32_t low = static_cast<std::uint32_t>(micros());
    if (low < low_) ++wraps_;
    low_ = low;
    return wraps_ << 32 | low_;
  }

 private:
  std::uint64_t wraps_ = 0;
  std::uint32_t low_ = 0;
};

}  // namespace robot_fw::esp8266
