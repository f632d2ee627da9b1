// Moves the reference.
#include "robot_fw/core/reference_profile.hpp"

#include <algorithm>
#include <cmath>

namespace robot_fw {

float ReferenceProfile::step(float setpoint_m, float position_m, const ProfileLimits& limits, float dt_s) {
  if (limits.velocity_m_s <= 0 && limits.acceleration_m_s2 <= 0) return setpoint_m;
  if (!started_) {
    started_ = true;
    speed_m_s_ = 0;
    reference_m_ = position_m;
    return reference_m_;
  }
  const float left_m = std::fabs(setpoint_m - reference_m_);
  float speed_m_s = left_m / dt_s;  // there in this tick
  if (limits.velocity_m_s > 0) speed_m_s = std::min(speed_m_s, limits.velocity_m_s);
  if (limits.acceleration_m_s2 > 0) {
    const float gain_m_s = limits.acceleration_m_s2 * dt_s;
    const float x = left_m / (gain_m_s * dt_s);
    const float n = std::max(1.0F, std::ceil((std::sqrt(1 + 8 * x) - 1) / 2));
    const float stop_m_s = gain_m_s * (x / n + (n - 1) / 2);             // (2)
    speed_m_s = std::min({speed_m_s, speed_m_s_ + gain_m_s, stop_m_s});  // (1)
  }
  speed_m_s_ = speed_m_s;
  const float step_m = speed_m_s * dt_s;
  const bool arrives = step_m >= left_m * 0.999'9F || left_m < 1e-6F;  // the last ulps in one go
  if (arrives) speed_m_s_ = 0;
  reference_m_ = arrives ? setpoint_m : reference_m_ + std::copysign(step_m, setpoint_m - reference_m_);
  return reference_m_;
}

}  // namespace robot_fw
