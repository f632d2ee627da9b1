// Finds how far the clock of a position that was measured from outside is off, by comparing two records of one motion.
//
//   d(t) = p(t + w/2) - p(t - w/2)                                                        (1)   motion within w
//   ρ(τ) = Σ d_out(t) d_own(t + τ) / √(Σ d_out(t)² · Σ d_own(t + τ)²)                     (2)   where both were
//   recorded p_out(t_j') - p_out(t_j) = g (p_own(t_j' + τ) - p_own(t_j + τ)) + e_j,  t_j' ≥ t_j + w   (3)   least
//   squares: τ, g covariance = B⁻¹ (Σ_b s_b s_bᵀ) B⁻¹,  B = JᵀJ,  s_b = Σ of J e over a block of time   (4)   e is
//   correlated in time
//
// τ → offset_s: a time of the outside record, plus it, is the time of the robot's own record. (1) does not contain the
// zero of either position, and hardly the slow drift of a position that is dead reckoning. (2) is looked at on a grid
// of 20 ms over all offsets at which the two overlap enough, by FFT; (3) then starts at its maximum, at the times at
// which the outside position was measured: no record is resampled.
// Refused, in words: too little motion, ρ below 0.8, another offset that fits nearly as well (a motion that repeats),
// or all of them over 2 s (a speed that does not change).
// Shapes:   times ascend; positions have one element per time and are finite. A pause over 0.25 s is a gap.
// Accuracy: within 3 offset_sd_s of a known offset at 25, 30 and 60 Hz with noise (clock_alignment_test.cpp).
//           The two clocks are taken to run at one rate: 50 ppm are 3 ms over a minute.
// Errors:   throws std::invalid_argument for shapes that do not fit; all else is a refusal in the result.
#pragma once

#include <limits>
#include <span>
#include <string>

namespace control {

struct PositionRecord {
  std::span<const double> time_s;
  std::span<const double> position_m;
};

struct OffsetRange {
  double from_s = -std::numeric_limits<double>::infinity();
  double to_s = std::numeric_limits<double>::infinity();
};

struct ClockAlignment {
  std::string refusal;  // empty: found
  double offset_s = 0;
  double offset_sd_s = 0;
  double correlation = 0;   // ρ at its maximum
  double motion_ratio = 0;  // g: motion of the outside record by that of the robot's own
};

ClockAlignment align_clocks(PositionRecord outside, PositionRecord own, OffsetRange range = {});

}  // namespace control
