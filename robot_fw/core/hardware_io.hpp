// The inputs of a tick from the hardware, and its outputs.
#pragma once

#include <cstdint>
#include <optional>

namespace robot_fw {

// Along the tube, forwards positive.
struct Motion {
  float position_m = 0;
  float velocity_m_s = 0;
  float acceleration_m_s2 = 0;
};

struct Inputs {
  std::uint64_t robot_time_us = 0;  // since boot, never goes back

  std::int16_t acceleration_counts = 0;  // along the tube, gravity removed, 100 per m/s²
  bool acceleration_is_valid = false;    // a reading came since the last tick
  // From a perfect sensor, in place of the estimate; only the simulator has one.
  std::optional<Motion> known_motion;

  float impedance_mv = 0;  // of the electrode; 0 when it could not be read
  float supply_mv = 0;
  bool motor_supply_is_cut = false;  // behind a switch that cuts the motor's supply; without a wire to sense it: false
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
