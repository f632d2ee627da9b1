// The motor between the duty that is asked for and the thrust: dead zone, supply, lag.
//
//   d = u · supply/nominal for |u| ≥ dead zone, else 0; with its wires swapped -d   (1)
//   τ w' = d - w                                                         (2)   w → what the plant gets
// A plant holds its duty over a tick, so it gets the mean of w over the tick: then no travel is lost to sampling.
//   mean of w = d + (w₀ - d) (τ/dt) (1 - e^{-dt/τ})                      (3)
// The paper's models (28) and (29) hold the motor's 22 ms already: (2) is what a motor has beyond that.
// Errors: check() throws std::invalid_argument quoting the bad value.
#pragma once

namespace sim_robot {

struct MotorParameters {
  double dead_zone_duty = 0;   // below it the motor stands still; [0, 1)
  double time_constant_s = 0;  // τ; 0: none; at most 10
  bool is_reversed = false;    // its wires are swapped: a positive duty drives backwards
};

void check(const MotorParameters& parameters);

class Motor {
 public:
  explicit Motor(const MotorParameters& parameters);

  // One tick under a duty, with a supply relative to the nominal one; returns the plant's duty.
  double step(double duty, double supply_ratio);

  // What the battery feeds: the duty, or 0 within the dead zone.
  double driven(double duty) const { return duty < dead_zone_duty_ && duty > -dead_zone_duty_ ? 0 : duty; }

 private:
  double dead_zone_duty_;
  double direction_;           // 1, or -1 when reversed
  double decay_, mean_share_;  // e^{-dt/τ}, and (τ/dt)(1 - e^{-dt/τ})
  double rate_ = 0;            // w
};

}  // namespace sim_robot
