// The step response of the closed loop with the fractional controller itself: no sampling, no clamp.
//
//   T(s) = K C(s)/Q(s),  Q(s) = s D(s) + K C(s)             (1)   K/D the plant's velocity, [birs2021] (20), (22), (23)
//   x(t) = setpoint (1 + (1/π) Im ∫_0^∞ G(s) e^{st} ds),  G = (T - 1)/s = -D/Q,  along s = x e^{iθ}                (2)
//        ≈ setpoint (1 + (δ/π) Im Σ_i G(s_i) s_i e^{s_i t}),  s_i = e^{y_i + iθ}                                   (3)
//   arg Q along the ray, from 0 to ∞, grows by nθ - 2π (zeros with 0 < arg < θ),  n = max(1 + α, μ)               (4)
//
// (2) holds for every ray that leaves all zeros of Q on its left; (4) finds how far that is, and whether the loop is
// stable at all. The ray runs midway between the imaginary axis and the first zero, or the cut; (3) converges like
// exp(-2πd/δ) with d the angle from the ray to either.
// Accuracy: 1e-9 relative from 0.02 s on, held by continuous_loop_test.cpp against the reference cases.
// Errors:   throws std::invalid_argument quoting the bad value, or saying that the loop is unstable.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "control/transfer_function.hpp"

namespace control {

class ContinuousLoop {
 public:
  ContinuousLoop(const FractionalModel& plant, const FopdController& controller);

  double position(double time_s) const;  // per setpoint; time_s ≥ 0
  double velocity(double time_s) const;  // its slope, 1/s; time_s > 0

 private:
  struct Node {
    Complex rate, weight;  // s_i; (δ/π) G(s_i) s_i
  };

  std::span<const Node> living(double time_s) const;  // the nodes that have not decayed by then

  std::vector<Node> nodes_;  // fastest first
};

struct ContinuousStep {
  double peak = 1;  // per setpoint; 1 if the setpoint is never passed before the horizon
  double peak_time_s = 0;
  double overshoot_percent = 0;
  std::optional<double> settling_2_percent_s;
};

ContinuousStep measure_continuous_step(const ContinuousLoop& loop, double horizon_s = 20);

}  // namespace control
