// Holds back a duty that is constant between steps by a dead time, which need not be a whole number of steps.
//
//   T = (n + f) dt,  0 ≤ f < 1:  of step k, the first f dt stand under u[k-n-1], the rest under u[k-n]      (1)
//
// Accuracy: exact; a T within 1e-9 of a whole number of steps is that number.
// Errors:   throws std::invalid_argument quoting a dead time of more than a million steps.
#pragma once

#include <cstddef>
#include <vector>

namespace control {

// The duties of one step, by (1). With f = 0 the earlier one acts for no time.
struct HeldDuty {
  double earlier = 0, later = 0;
};

class DelayLine {
 public:
  DelayLine(double dead_time_s, double dt_s);

  // Takes the duty of the next step.
  HeldDuty push(double duty);
  void reset();

  double earlier_share() const { return earlier_share_; }  // f

 private:
  std::vector<double> duties_;  // those that still wait, and the one that acted last; a ring
  std::size_t oldest_ = 0;
  double earlier_share_ = 0;
};

}  // namespace control
