// The step response of the closed loop with the fractional controller itself: no sampling, no clamp.
//
//   T(s) = K C(s)/Q(s),  Q(s) = s D(s) + K C(s)             (1)   K/D the plant's velocity, [birs2021] (20), (22), (23)
//   x(t) = setpoint (1 + L⁻¹[G]),  G = (T - 1)/s = -D/Q                                                           (2)
//   L⁻¹[G] = -e^{-at} + Σ_p 2 Re[r e^{pt}] + (1/π) Im ∫_0^∞ (G + 1/(s + a)) e^{st} ds  along s = x e^{iθ}         (3)
//   r = -D(p)/Q'(p) for the zeros p of Q with 0 < arg p < θ; a: where |K C| = |s D| on the imaginary axis
//   ∫ ≈ δ Σ_i (G(s_i) + 1/(s_i + a)) s_i e^{s_i t},  s_i = e^{y_i + iθ}                                           (4)
//   arg Q along a ray, from 0 to ∞, grows to nθ - 2π (zeros with 0 < arg < θ),  n = 1 + α, or 1 + β if b1 = 0      (5)
//
// (5) counts the zeros before any ray, its steps made as fine as a zero beside the ray demands; so bisection finds the
// angle of each zero, and says whether the loop is stable at all. The ray runs in the middle of the widest of the gaps
// between the imaginary axis, the zeros and the cut, which is wide for every loop however lightly damped; (4) converges
// like exp(-2πd/δ) with d the angle from the ray to the ends of its gap. 1/(s + a) lets the sum begin and end near the
// loop's own time scale.
// Accuracy: 1e-9 relative from 0.02 s on, held by continuous_loop_test.cpp against the reference cases; 1e-9 of the
//           setpoint against the partial fractions of (28) to within 0.1 % of its limit of stability. From 1.7 s on the
//           reference for (28) is itself off, by up to 1.7e-5: presumably its contour leaves out the loop's poles.
//           There, the test holds that two different rays agree to 1e-12.
// Errors:   throws std::invalid_argument quoting the bad value, or saying that the loop is unstable. μ must be
//           0.25 below n, or T hardly falls off and the loop would follow at once. A plant with a dead time is refused:
//           Q then has zeros without end.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "control/models/transfer_function.hpp"

namespace control {

class ContinuousLoop {
 public:
  // ray: where it runs within its gap, 0 at one end, 1 at the other. No result depends on it.
  ContinuousLoop(const FractionalModel& plant, const FopdController& controller, double ray = 0.5);

  double position(double time_s) const;              // per setpoint; time_s ≥ 0
  double velocity(double time_s) const;              // its slope, 1/s; time_s > 0
  double rate_rad_s() const { return rate_rad_s_; }  // a of (3): how fast the loop is

 private:
  struct Node {
    Complex rate, weight;  // Im[weight e^{rate t}]
  };

  std::span<const Node> living(double time_s) const;  // the nodes that have not decayed by then

  std::vector<Node> nodes_;  // of (4), fastest first
  std::vector<Node> poles_;  // of (3)
  double rate_rad_s_ = 0;
};

struct ContinuousStep {
  double peak = 1;  // per setpoint; 1 if the setpoint is never passed before the horizon
  double peak_time_s = 0;
  double overshoot_percent = 0;
  std::optional<double> settling_2_percent_s;
};

ContinuousStep measure_continuous_step(const ContinuousLoop& loop, double horizon_s = 20);

}  // namespace control
