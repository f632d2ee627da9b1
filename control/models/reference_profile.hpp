// The reference on its way to the setpoint: limited in velocity and acceleration, from rest to rest.
//
//   accelerate at a for v/a, cruise at v, brake at a; from distance < v²/a on without a cruise: peak velocity √(a d)
//   (1)
//
// It ends at the setpoint exactly and never passes it. A limit of 0 is no limit: without both it is a plain step.
// Errors: throws std::invalid_argument quoting the bad value.
#pragma once

namespace control {

class ReferenceProfile {
 public:
  ReferenceProfile(double distance_m, double velocity_m_s, double acceleration_m_s2);
  double position_m(double time_s) const;

 private:
  double distance_m_;        // with its sign
  double velocity_m_s_ = 0;  // the highest reached
  double ramp_s_ = 0, duration_s_ = 0;
};

}  // namespace control
