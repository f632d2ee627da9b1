// Lights the LED.
#include "robot_fw/esp8266/status_led.hpp"

#include <Arduino.h>

namespace robot_fw::esp8266 {

bool lit(LedPattern pattern, std::uint64_t now_us) {
  const std::uint32_t ms = static_cast<std::uint32_t>(now_us / 1000 % 2000);
  switch (pattern) {
    case LedPattern::connecting: return ms % 1000 < 500;
    case LedPattern::connected: return ms < 100;
    case LedPattern::refused: return ms < 900 && ms % 300 < 100;
    case LedPattern::emergency: return ms % 200 < 100;
  }
  return false;
}

void StatusLed::begin() {
  light(false);
  pinMode(settings_.pin, OUTPUT);
}

void StatusLed::show(LedPattern pattern, std::uint64_t now_us) {
  const bool on = lit(pattern, now_us);
  if (on != on_) light(on);
}

void StatusLed::light(bool on) {
  digitalWrite(settings_.pin, on != settings_.lit_when_low ? HIGH : LOW);
  on_ = on;
}

}  // namespace robot_fw::esp8266
