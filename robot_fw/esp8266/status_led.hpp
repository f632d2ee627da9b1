// The status LED: its rhythm shows the robot's state.
//
//   connecting  1 s: half on, half off
//   connected   2 s: one short flash
//   refused     2 s: three short flashes (unknown robot, wrong token, another version), its key is none, or no memory
//   emergency   0.2 s: half on, half off; whatever the link does
#pragma once

#include <cstdint>

#include "robot_fw/esp8266/settings.hpp"

namespace robot_fw::esp8266 {

enum class LedPattern { connecting, connected, refused, emergency };

// Whether the LED is lit at this time.
bool lit(LedPattern pattern, std::uint64_t now_us);

class StatusLed {
 public:
  explicit StatusLed(const LedSettings& settings) : settings_(settings) {}

  void begin();
  void show(LedPattern pattern, std::uint64_t now_us);

 private:
  void light(bool on);

  LedSettings settings_;
  bool on_ = false;
};

}  // namespace robot_fw::esp8266
