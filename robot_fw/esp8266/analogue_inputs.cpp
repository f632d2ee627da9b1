// Reads the analogue input.
#include "robot_fw/esp8266/analogue_inputs.hpp"

#include <Arduino.h>

namespace robot_fw::esp8266 {
namespace {

constexpr std::uint32_t kTicksPerSupplyReading = 100;

// 10 bits for 0 to 1 V at the chip's pin.
float pin_mv() { return static_cast<float>(analogRead(A0)) * (1000.0F / 1023.0F); }

}  // namespace

void AnalogueInputs::begin() {
  if (settings_.supply_pin == kNoPin) return;
  select_supply(false);
  pinMode(static_cast<std::uint8_t>(settings_.supply_pin), OUTPUT);
}

// The switch has one tick to settle, each way.
void AnalogueInputs::read() {
  const std::uint32_t turn = ticks_++ % kTicksPerSupplyReading;
  if (settings_.supply_pin == kNoPin || turn > 1) {
    impedance_mv_ = pin_mv() * settings_.impedance_scale;
  } else if (turn == 0) {
    select_supply(true);
  } else {
    supply_mv_ = pin_mv() * settings_.supply_scale;
    select_supply(false);
  }
}

void AnalogueInputs::select_supply(bool supply) {
  digitalWrite(static_cast<std::uint8_t>(settings_.supply_pin), supply ? HIGH : LOW);
}

}  // namespace robot_fw::esp8266
