// The motor's pin: PWM made in the timer interrupt, which also turns it off when the ticks stop.
//
//   share = 0                                  for duty = 0
//   share = dead_zone + (1 - dead_zone) |duty|  otherwise
// One interrupt owns the pin. It raises the pin only while armed, and only a completed tick arms it, for just under
// 50 ms. It is the chip's non-maskable interrupt, so it runs while interrupts are off, during a crash dump and while
// flash is written; it uses only RAM and two registers.
// One motor a program, since the interrupt has no owner.
#pragma once

#include <cstdint>

#include "robot_fw/esp8266/settings.hpp"

namespace robot_fw::esp8266 {

constexpr std::uint32_t kDeadManUs = 50'000;  // in cycles at F_CPU: twice as long while the SDK runs the chip at 80 MHz

// The share of time for which the pin is high, in [0, 1]; 0 for what is not a number.
float pwm_share(float duty, float dead_zone);

class Motor {
 public:
  explicit Motor(const MotorSettings& settings) : settings_(settings) {}

  // The pin is low from here on, and the interrupt runs.
  void begin();
  // A tick has completed: its duty is on the motor until the next, or for 50 ms. The first duty of the other sign is
  // left out: the motor is off for that tick, and the next one turns the bridge.
  void complete_tick(float duty);
  // Between ticks: 0 is off at once, anything else waits for a tick.
  void follow(float duty);

  // The pin is low and stays so until a tick completes.
  bool is_off() const;
  // How often the interrupt had to turn a running motor off, since boot.
  std::uint32_t dead_man_trips() const;
  // The lowest duty it can follow: 0 without a direction pin.
  float duty_min() const { return settings_.direction_pin == kNoPin ? 0.0F : -1.0F; }

 private:
  void turn(bool backwards);

  MotorSettings settings_;
  bool backwards_ = false;
  bool drove_ = false;  // in the latest tick
};

// Off by registers alone: at boot before anything is set up, and in a crash.
void force_motor_off(std::uint8_t pwm_pin);

}  // namespace robot_fw::esp8266
