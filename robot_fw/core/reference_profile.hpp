// Moves the reference from the robot's position to the setpoint with limited speed and acceleration.
//
//   v[k] = min(v[k-1] + a·T, v_max, v_stop(d)),   r[k] = r[k-1] + v[k]·T                      (1)
//   v_stop(d) = a·T·(x/n + (n-1)/2),  x = d/(a·T²),  n = ⌈(√(1 + 8x) - 1)/2⌉              (2)
//       from it, a·T less in each of n ticks, d is just enough
//   d → distance left in m;  T → dt_s;  v_max, a → ProfileLimits
// The first reference is the measured position, at speed 0. A limit of 0 means no limit; without both limits the
// reference is the setpoint from the first tick on.
#pragma once

namespace robot_fw {

struct ProfileLimits {
  float velocity_m_s = 0;
  float acceleration_m_s2 = 0;
};

class ReferenceProfile {
 public:
  // The next step() starts anew, from the position measured then.
  void restart() { started_ = false; }
  // Once per tick.
  float step(float setpoint_m, float position_m, const ProfileLimits& limits, float dt_s);

 private:
  bool started_ = false;
  float reference_m_ = 0;
  float speed_m_s_ = 0;  // towards the setpoint
};

}  // namespace robot_fw
