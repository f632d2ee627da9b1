// Makes the PWM and watches the ticks.
#include "robot_fw/esp8266/motor.hpp"

#include <Arduino.h>
#include <core_esp8266_waveform.h>

#include <cmath>

namespace robot_fw::esp8266 {
namespace {

// Shared with the interrupt, which cannot be held off: each word is written whole, and `armed` last. In CPU cycles.
struct Wave {
  std::uint32_t pin_mask;
  std::uint32_t period;
  std::uint32_t high;  // of each period
  std::uint32_t period_start;
  std::uint32_t deadline;
  bool armed;
  std::uint32_t trips;
};
volatile Wave wave{};

// Returns the cycles until it wants to run again. In RAM, with nothing called that is not.
std::uint32_t IRAM_ATTR drive_pin() {
  const std::uint32_t now = esp_get_cycle_count();
  if (wave.armed && static_cast<std::int32_t>(now - wave.deadline) >= 0) {
    wave.armed = false;  // SAFETY: no tick completed in time, so nobody controls the motor
    wave.trips = wave.trips + 1;
  }
  if (!wave.armed) {
    GPOC = wave.pin_mask;
    return wave.period;
  }
  std::uint32_t phase = now - wave.period_start;
  if (phase >= wave.period) {
    wave.period_start = now;
    phase = 0;
  }
  if (phase < wave.high) {
    GPOS = wave.pin_mask;
    return wave.high - phase;
  }
  GPOC = wave.pin_mask;
  return wave.period - phase;
}

void disarm() {
  wave.armed = false;
  GPOC = wave.pin_mask;  // SAFETY: low now, not from the next period on
}

}  // namespace

float pwm_share(float duty, float dead_zone) {
  const float size = std::fabs(duty);
  if (!(size > 0)) return 0;  // also for what is not a number
  const float share = dead_zone + (1 - dead_zone) * size;
  return share < 1 ? share : 1;
}

void force_motor_off(std::uint8_t pwm_pin) {
  wave.armed = false;
  GPOC = 1U << pwm_pin;  // SAFETY: a software reset leaves pins as they were
}

void Motor::begin() {
  wave.pin_mask = 1U << settings_.pwm_pin;
  wave.period = clockCyclesPerMicrosecond() * (1'000'000U / settings_.pwm_hz);
  wave.high = 0;
  wave.trips = 0;
  disarm();
  digitalWrite(settings_.pwm_pin, LOW);  // SAFETY: low before it becomes an output
  pinMode(settings_.pwm_pin, OUTPUT);
  if (settings_.direction_pin != kNoPin) {
    digitalWrite(static_cast<std::uint8_t>(settings_.direction_pin), LOW);
    pinMode(static_cast<std::uint8_t>(settings_.direction_pin), OUTPUT);
  }
  setTimer1Callback(&drive_pin);
}

void Motor::complete_tick(float duty) {
  const bool possible = duty >= duty_min();  // false for what is not a number
  const float share = possible ? pwm_share(duty, settings_.dead_zone) : 0;
  const bool turns = settings_.direction_pin != kNoPin && (duty < 0) != backwards_;
  if (share <= 0 || (turns && drove_)) {
    drove_ = false;
    return disarm();
  }
  if (turns) turn(duty < 0);
  drove_ = true;
  wave.high = static_cast<std::uint32_t>(share * static_cast<float>(wave.period));
  // One period earlier than it must be: the interrupt may be one period away when the deadline comes.
  wave.deadline = esp_get_cycle_count() + clockCyclesPerMicrosecond() * kDeadManUs - wave.period;
  wave.armed = true;
}

void Motor::follow(float duty) {
  if (!(std::fabs(duty) > 0)) disarm();  // SAFETY: a stop between two ticks does not wait for the next
}

// SAFETY: only after a tick of 0, in which the current of the direction before has died away (assumed: the windings'
// time constant is below 1 ms). The propeller may still turn.
void Motor::turn(bool backwards) {
  digitalWrite(static_cast<std::uint8_t>(settings_.direction_pin), backwards ? HIGH : LOW);
  backwards_ = backwards;
}

bool Motor::is_off() const { return !wave.armed; }
std::uint32_t Motor::dead_man_trips() const { return wave.trips; }

}  // namespace robot_fw::esp8266
