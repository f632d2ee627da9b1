// The accelerometer: a Bosch BNO055 over I2C, in the mode that fuses accelerometer and gyroscope (IMUPLUS).
//
//   0x00       chip id, 0xA0
//   0x28..0x2D linear acceleration x, y, z: little-endian s16, 100 per m/s²
//   0x35       calibration: bits 5..4 gyroscope, 3..2 accelerometer, each 0 to 3
//   0x3B, 0x3D units, operating mode
// The mode with the magnetometer is not used: the steel around the tubes disturbs it. BNO055 data sheet, section 4.
// A read stretches the clock and takes about 2 ms. Starting takes 0.8 s in steps that never wait.
#pragma once

#include <cstdint>

#include "robot_fw/esp8266/settings.hpp"

namespace robot_fw::esp8266 {

class Bno055 {
 public:
  struct Reading {
    std::int16_t acceleration_counts = 0;  // along the tube, forwards positive, 100 per m/s²
    bool is_valid = false;
    std::uint32_t calibration = 0;  // the lower of the two, 0 to 3
  };

  explicit Bno055(const ImuSettings& settings) : settings_(settings) {}

  void begin(std::uint64_t now_us);
  // Once per tick: a reading, or a step towards one. Starts the sensor anew after ten failures in a row, or when it
  // has left its mode, as it does after a dip of its supply.
  Reading read(std::uint64_t now_us);
  bool running() const { return phase_ == Phase::running; }

 private:
  enum class Phase { booting, configuring, starting, running };

  void restart(std::uint64_t now_us, std::uint32_t wait_us);
  void enter(Phase phase, std::uint64_t now_us, std::uint32_t wait_us);
  void start_up(std::uint64_t now_us);
  Reading failed(std::uint64_t now_us);
  bool read_registers(std::uint8_t first, std::uint8_t* bytes, std::uint8_t count) const;
  bool write_register(std::uint8_t address, std::uint8_t value) const;

  ImuSettings settings_;
  Phase phase_ = Phase::booting;
  std::uint64_t ready_at_us_ = 0;  // the phase lasts at least until then
  std::uint8_t failures_ = 0;      // in a row
  std::uint8_t reads_ = 0;         // since the mode was looked at
};

}  // namespace robot_fw::esp8266
