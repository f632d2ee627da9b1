// Brings a recorded acceleration back to what the accelerometer said.
//
//   recorded_k = reading_k - b_k,  reading_k = quantum · counts_k                           (1) robot_fw/core/estimator
// b is the bias of the robot's own filter, which leans on the model that is built into it: a fit of (1) would find that
// model again. It changes in every fifth tick only and by far less than half a quantum at a time, so the remainder of
// recorded_k by the quantum tells b_k but for one constant: the readings come back exactly, whatever the filter
// thought. Where the quantum does not show, the record is taken as it is, and a bias that wanders must be fitted.
// Errors: none thrown.
#pragma once

#include <span>
#include <vector>

namespace control {

inline constexpr double kReadingQuantumM_S2 = 0.01;  // of the BNO055, which the robots carry

struct SensorReadings {
  std::vector<double> reading_m_s2;  // but for a constant
  // The record repeats itself: by chance, because the same sample was read twice, or because a read failed.
  std::vector<bool> is_repeated;
  bool are_recovered = false;  // the quantum shows
};

SensorReadings sensor_readings(std::span<const double> acceleration_m_s2);

}  // namespace control
