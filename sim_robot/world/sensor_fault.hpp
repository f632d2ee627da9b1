// What can be wrong with a sensor of the simulated robot, on top of what it always is.
#pragma once

namespace sim_robot {

enum class Sensor { accelerometer, electrode };

enum class SensorFaultKind {
  none,
  stuck,    // gives the same reading for ever
  noisy,    // white noise of sd `magnitude` on top
  offset,   // `magnitude` on top
  missing,  // gives no reading
};

struct SensorFault {
  SensorFaultKind kind = SensorFaultKind::none;
  double magnitude = 0;  // m/s² of the accelerometer, mV of the electrode
};

// Throws std::invalid_argument quoting the bad value.
void check(const SensorFault& fault);

}  // namespace sim_robot
