// What a tick reads from the hardware and what it gives back.
#pragma once

#include <cstdint>

namespace robot_fw {

struct Inputs {
  std::uint64_t robot_time_us = 0;  // since boot, never goes back

  // A perfect position sensor; positions count along the tube, forwards positive.
  float position_m = 0;
  float velocity_m_s = 0;
  float acceleration_m_s2 = 0;

  float impedance_mv = 0;
  float supply_mv = 0;
  std::int32_t rssi_dbm = 0;
  std::uint32_t free_memory_bytes = 0;
  std::uint32_t tick_us = 0;          // how long the last tick took
  std::uint32_t missed_ticks = 0;     // since boot
  std::uint32_t imu_calibration = 0;  // 0 to 3
};

struct Outputs {
  float duty = 0;  // of the motor, in [-1, 1]; 0 coasts
};

}  // namespace robot_fw
