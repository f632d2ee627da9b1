// Starts the sensor step by step and reads it.
#include "robot_fw/esp8266/bno055.hpp"

#include <Arduino.h>
#include <Wire.h>

namespace robot_fw::esp8266 {
namespace {

constexpr std::uint8_t kChipIdAt = 0x00, kChipId = 0xA0;
constexpr std::uint8_t kAccelerationAt = 0x28, kCalibrationAt = 0x35;
constexpr std::uint8_t kUnitsAt = 0x3B, kMetresPerSecondSquared = 0x00;
constexpr std::uint8_t kModeAt = 0x3D, kConfigMode = 0x00, kImuPlusMode = 0x08;

constexpr std::uint32_t kBootUs = 700'000;           // after power-on; the data sheet says 650 ms at most
constexpr std::uint32_t kRetryUs = 100'000;          // between two questions for the chip id
constexpr std::uint32_t kToConfigModeUs = 20'000;    // data sheet: 19 ms
constexpr std::uint32_t kFromConfigModeUs = 20'000;  // data sheet: 7 ms
constexpr std::uint32_t kStretchLimitUs = 1'500;
constexpr std::uint8_t kFailuresToRestart = 10;
constexpr std::uint8_t kReadsPerModeCheck = 100;

std::int16_t word_at(const std::uint8_t* bytes) {
  return static_cast<std::int16_t>(static_cast<std::uint16_t>(bytes[0] | bytes[1] << 8));
}

std::int16_t reversed(std::int16_t counts) {
  return counts == INT16_MIN ? INT16_MAX : static_cast<std::int16_t>(-counts);
}

}  // namespace

void Bno055::begin(std::uint64_t now_us) { restart(now_us, kBootUs); }

void Bno055::restart(std::uint64_t now_us, std::uint32_t wait_us) {
  Wire.begin(settings_.sda_pin, settings_.scl_pin);
  Wire.setClock(400'000);
  Wire.setClockStretchLimit(kStretchLimitUs);
  (void)Wire.status();  // clocks a sensor that holds the data line out of its byte; nothing else does
  failures_ = reads_ = 0;
  enter(Phase::booting, now_us, wait_us);
}

void Bno055::enter(Phase phase, std::uint64_t now_us, std::uint32_t wait_us) {
  phase_ = phase;
  ready_at_us_ = now_us + wait_us;
}

Bno055::Reading Bno055::read(std::uint64_t now_us) {
  if (phase_ != Phase::running) {
    if (now_us >= ready_at_us_) start_up(now_us);
    return {};
  }
  if (++reads_ >= kReadsPerModeCheck) {
    std::uint8_t mode = 0;
    if (!read_registers(kModeAt, &mode, 1)) return failed(now_us);  // and asks again in the next tick
    if (mode != kImuPlusMode) {
      restart(now_us, kRetryUs);
      return {};
    }
    reads_ = 0;
  }
  std::uint8_t bytes[kCalibrationAt - kAccelerationAt + 1];
  if (!read_registers(kAccelerationAt, bytes, sizeof(bytes))) return failed(now_us);
  failures_ = 0;
  const std::int16_t counts = word_at(bytes + 2 * settings_.axis);
  const std::uint8_t calibration = bytes[kCalibrationAt - kAccelerationAt];
  const std::uint32_t gyroscope = calibration >> 4 & 3U, accelerometer = calibration >> 2 & 3U;
  return {settings_.reversed ? reversed(counts) : counts, true, gyroscope < accelerometer ? gyroscope : accelerometer};
}

void Bno055::start_up(std::uint64_t now_us) {
  switch (phase_) {
    case Phase::booting: {
      std::uint8_t chip_id = 0;
      const bool there = read_registers(kChipIdAt, &chip_id, 1) && chip_id == kChipId;
      if (!there || !write_register(kModeAt, kConfigMode)) return restart(now_us, kRetryUs);
      return enter(Phase::configuring, now_us, kToConfigModeUs);
    }
    case Phase::configuring: {
      const bool is_configured =
          write_register(kUnitsAt, kMetresPerSecondSquared) && write_register(kModeAt, kImuPlusMode);
      if (!is_configured) return restart(now_us, kRetryUs);
      return enter(Phase::starting, now_us, kFromConfigModeUs);
    }
    case Phase::starting: return enter(Phase::running, now_us, 0);
    case Phase::running: return;
  }
}

Bno055::Reading Bno055::failed(std::uint64_t now_us) {
  if (++failures_ >= kFailuresToRestart) restart(now_us, kRetryUs);
  return {};
}

bool Bno055::read_registers(std::uint8_t first, std::uint8_t* bytes, std::uint8_t count) const {
  Wire.beginTransmission(settings_.address);
  Wire.write(first);
  if (Wire.endTransmission(static_cast<std::uint8_t>(false)) != 0) return false;
  if (Wire.requestFrom(settings_.address, count) != count) return false;
  for (std::uint8_t i = 0; i < count; ++i) bytes[i] = static_cast<std::uint8_t>(Wire.read());
  return true;
}

bool Bno055::write_register(std::uint8_t address, std::uint8_t value) const {
  Wire.beginTransmission(settings_.address);
  Wire.write(address);
  Wire.write(value);
  return Wire.endTransmission() == 0;
}

}  // namespace robot_fw::esp8266
