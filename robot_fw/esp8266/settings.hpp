// The board's pins, and the conversion of readings to units. The only file to change for another board.
#pragma once

#include <cstdint>

namespace robot_fw::esp8266 {

constexpr std::int8_t kNoPin = -1;

struct MotorSettings {
  std::uint8_t pwm_pin = 5;            // 0 to 15; needs a pull-down of 10 kΩ: through a reset nobody drives it
  std::int8_t direction_pin = kNoPin;  // high for a negative duty; none: the duty is in [0, 1]
  std::uint32_t pwm_hz = 1000;         // 100 to 1000
  float dead_zone = 0.0F;              // share of PWM below which the propeller stands still, in [0, 0.9]
};

struct ImuSettings {
  std::uint8_t sda_pin = 4;
  std::uint8_t scl_pin = 14;
  std::uint8_t address = 0x28;
  std::uint8_t axis = 0;  // of the sensor that lies along the tube: 0 x, 1 y, 2 z
  bool reversed = false;  // that axis points backwards
};

struct AnalogueSettings {
  float impedance_scale = 1.0F;     // electrode's mV per mV at the pin, which reads 0 to 1000
  std::int8_t supply_pin = kNoPin;  // high switches the one analogue input to the supply; none: not measured
  float supply_scale = 5.7F;        // supply's mV per mV at the pin: 47 kΩ over 10 kΩ
};

// A transistor pulls the line low while the motor has its supply. High: a switch has cut it, or the line is broken.
struct MotorSupplySettings {
  std::int8_t sense_pin = kNoPin;  // 12 is free; none: not sensed
};

struct LedSettings {
  std::uint8_t pin = 2;
  bool lit_when_low = true;
};

struct Settings {
  MotorSettings motor;
  ImuSettings imu;
  AnalogueSettings analogue;
  LedSettings led;
  MotorSupplySettings motor_supply;
};

constexpr Settings kSettings{};
static_assert(kSettings.motor.pwm_pin < 16, "the interrupt writes the register of GPIO 0 to 15");

}  // namespace robot_fw::esp8266
