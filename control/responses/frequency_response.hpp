// The plant, the controller and their product along the positive imaginary axis, each with its logarithmic slope.
//
//   P(jω) = kp/(D(jω) jω)  for position,  kp/D(jω)  for velocity    (1)   [birs2021] (20), (22)
//           times e^{-jωT} with a dead time: phase -ωT, slope -ωT  (1a)
//   C(jω) = kp (1 + kd (jω)^μ)                                     (2)   [birs2021] (23)
//   d ln F/d ln ω = d ln|F|/d ln ω + i d arg F/d ln ω              (3)   analytic; slopes of a product add
//
// The frequency is given as ln ω: models of milliseconds and of hours are then alike. The phases are unwrapped: D and
// C never leave the upper half plane, and the dead time's phase is a number. A negative plant gain counts as -180
// degrees. Accuracy: a few units of rounding while |ln ω| ≤ kLargestLogOmega. Errors:   none; the arguments have been
// checked.
#pragma once

#include <numbers>

#include "control/models/transfer_function.hpp"

namespace control {

constexpr double kDegPerRad = 180 / std::numbers::pi;
constexpr double kLargestLogOmega = 150;  // 1e65 rad/s; the squares of s² are still numbers there

// A complex function of frequency at one point of the axis.
struct AxisPoint {
  Complex value;
  double log_magnitude = 0;
  double phase_rad = 0;  // unwrapped
  Complex log_slope;     // (3)
};

AxisPoint operator*(const AxisPoint& a, const AxisPoint& b);

// (1)
class PlantOnAxis {
 public:
  PlantOnAxis(const FractionalModel& model, bool is_velocity_loop);
  AxisPoint at(double log_omega) const;

 private:
  FractionalModel model_;
  Complex alpha_direction_, beta_direction_;  // j^α, j^β
  double log_gain_, integrators_, phase_at_0_rad_, dead_time_s_;
};

// (2)
class ControllerOnAxis {
 public:
  explicit ControllerOnAxis(const FopdController& controller);
  AxisPoint at(double log_omega) const;

 private:
  FopdController controller_;
  Complex direction_;  // j^μ
  double log_gain_;
};

}  // namespace control
