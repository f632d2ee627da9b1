// The chip's one analogue input: the electrode (DS550), and the supply voltage where a switch connects it once a
// second.
#pragma once

#include <cstdint>

#include "robot_fw/esp8266/settings.hpp"

namespace robot_fw::esp8266 {

class AnalogueInputs {
 public:
  explicit AnalogueInputs(const AnalogueSettings& settings) : settings_(settings) {}

  void begin();
  // Once per tick. For the tick in which the supply is read and the one before, the impedance stays what it was.
  void read();

  float impedance_mv() const { return impedance_mv_; }
  float supply_mv() const { return supply_mv_; }  // 0 where it is not measured

 private:
  void select_supply(bool supply);

  AnalogueSettings settings_;
  std::uint32_t ticks_ = 0;
  float impedance_mv_ = 0;
  float supply_mv_ = 0;
};

}  // namespace robot_fw::esp8266
