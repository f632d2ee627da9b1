// The three pieces of the trapezoid, in closed form.
#include "control/models/reference_profile.hpp"

#include <cmath>

#include "base/invalid_argument.hpp"

namespace control {
namespace {

void check_limit(const char* name, double value) {
  if (value >= 0 && std::isfinite(value)) return;
  base::throw_invalid("reference profile: ", name, " must be positive, or 0 for no limit, is ", value);
}

}  // namespace

ReferenceProfile::ReferenceProfile(double distance_m, double velocity_m_s, double acceleration_m_s2)
    : distance_m_(distance_m) {
  check_limit("velocity_m_s", velocity_m_s);
  check_limit("acceleration_m_s2", acceleration_m_s2);
  const double length_m = std::abs(distance_m);
  if ((velocity_m_s == 0 && acceleration_m_s2 == 0) || length_m == 0) return;
  velocity_m_s_ = velocity_m_s;
  if (acceleration_m_s2 > 0) {
    const double peak_m_s = std::sqrt(acceleration_m_s2 * length_m);
    if (velocity_m_s == 0 || peak_m_s < velocity_m_s) velocity_m_s_ = peak_m_s;
    ramp_s_ = velocity_m_s_ / acceleration_m_s2;
  }
  duration_s_ = length_m / velocity_m_s_ + ramp_s_;
}

double ReferenceProfile::position_m(double time_s) const {
  if (time_s >= duration_s_) return distance_m_;
  if (time_s <= 0) return 0;
  const double length_m = std::abs(distance_m_), left_s = duration_s_ - time_s;
  double covered_m = velocity_m_s_ * (time_s - ramp_s_ / 2);
  if (time_s < ramp_s_) covered_m = velocity_m_s_ * time_s * time_s / (2 * ramp_s_);
  if (left_s < ramp_s_) covered_m = length_m - velocity_m_s_ * left_s * left_s / (2 * ramp_s_);
  return std::copysign(covered_m, distance_m_);
}

}  // namespace control
