// Integrates drag and speed side by side.
#include "sim_robot/world/shear_thinning_plant.hpp"

#include <cmath>

#include "base/invalid_argument.hpp"

namespace sim_robot {
namespace {

constexpr double kSizedAtDuty = 0.6;

void need(const char* name, double value, double least, double most) {
  if (!(value >= least && value <= most)) {
    base::throw_invalid(name, " is ", value, ", allowed is ", least, " to ", most);
  }
}

}  // namespace

void check(const ShearThinningParameters& p) {
  need("speed_at_0_6_m_s", p.speed_at_0_6_m_s, 0.001, 10);
  need("thrust_m_s2", p.thrust_m_s2, 0.01, 100);
  need("exponent", p.exponent, 0.3, 1);
  need("relaxation_s", p.relaxation_s, 0.01, 10);
  need("linear_below_m_s", p.linear_below_m_s, 1e-4, 1);
  need("motor_time_constant_s", p.motor_time_constant_s, 0.001, 10);
}

ShearThinningPlant::ShearThinningPlant(const ShearThinningParameters& p, double dt_s, int steps)
    : steps_(steps),
      step_s_(dt_s / steps),
      thrust_(p.thrust_m_s2),
      slope_exponent_((p.exponent - 1) / 2),
      linear_below_squared_(p.linear_below_m_s * p.linear_below_m_s),
      relaxation_s_(p.relaxation_s),
      half_decay_(std::exp(-step_s_ / 2 / p.motor_time_constant_s)) {
  check(p);
  drag_ = thrust_ * kSizedAtDuty / (relaxation_s_ * drag_slope(p.speed_at_0_6_m_s, 0));
}

double ShearThinningPlant::drag_slope(double velocity_m_s, double drag_m_s2) const {
  const double size_squared = velocity_m_s * velocity_m_s + linear_below_squared_;
  return (drag_ * velocity_m_s * std::pow(size_squared, slope_exponent_) - drag_m_s2) / relaxation_s_;
}

void ShearThinningPlant::step(double duty) {
  const double h = step_s_;
  for (int i = 0; i < steps_; ++i) {
    const double start = thrust_ * driven_;
    const double middle_share = duty + (driven_ - duty) * half_decay_;  // (1)
    driven_ = duty + (middle_share - duty) * half_decay_;
    const double middle = thrust_ * middle_share, end = thrust_ * driven_;
    const double v = velocity_m_s_, r = drag_m_s2_;
    const double v1 = start - r, r1 = drag_slope(v, r);  // (2), (3)
    const double v2 = middle - r - h / 2 * r1, r2 = drag_slope(v + h / 2 * v1, r + h / 2 * r1);
    const double v3 = middle - r - h / 2 * r2, r3 = drag_slope(v + h / 2 * v2, r + h / 2 * r2);
    const double v4 = end - r - h * r3, r4 = drag_slope(v + h * v3, r + h * r3);
    position_m_ += h * (v + h / 6 * (v1 + v2 + v3));  // (4)
    velocity_m_s_ += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
    drag_m_s2_ += h / 6 * (r1 + 2 * r2 + 2 * r3 + r4);
  }
}

}  // namespace sim_robot
