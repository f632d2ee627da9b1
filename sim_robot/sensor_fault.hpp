// What can be wrong with a sensor of the simulated robot, on top of what it always is.
#pragma once

namespace sim_robot {

enum class Sensor { accelerometer, electrode };

enum class FaultKind {
  none,
  stuck,    // gives the same reading for ever
  noisy,    // white noise of sd `magnitude` on top
  offset,   // `magnitude` on top
  missing,  // gives no reading
};

struct Fault {
  FaultKind kind = FaultKind::none;
  double magnitude = 0;  // m/s² of the accelerometer, mV of the electrode
};

// Throws std::invalid_argument quoting the bad value.
void check(const Fault& fault);

}  // namespace sim_robot
