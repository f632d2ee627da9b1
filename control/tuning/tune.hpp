// Tunes the fractional PD controller to gain crossover, phase margin and iso-damping, in closed form.
//
//   |C(jω)P(jω)| = 1, arg C(jω)P(jω) = -π + φ_m, d arg CP/dω = 0 at ω = ω_gc     (1)   [birs2021] (24), (25), (26)
//   θ = -π + φ_m - arg P(jω_gc),  R = -d arg P/d ln ω,  q = μπ/2                 (2)
//   kd ω^μ = sin θ/sin(q - θ)                                                   (3)   from the phase
//   μ sin θ sin(q - θ)/sin q = R                                                (4)   from the slope: monotone in μ
//   0 < θ < 90° and R < sin(2θ)/2                                               (5)   a solution with 0 < μ < 1 exists
//                                                                                     exactly then, and it is unique
//   kp = 1/(|1 + kd (jω)^μ| |P(jω)|)                                            (6)
//
// (1) looks at one crossover. Its solution is given only if the closed loop is stable and no other crossover has a
// smaller phase margin; otherwise it is refused with that reason, like a specification without a solution.
//
// The left side of (4) is the slope that the controller adds, R the slope that the plant takes away. With 1 < μ < 2 (4)
// has a solution for every 0 < θ < 180°; such a controller amplifies noise more than a derivative, and is named so.
// Accuracy: crossover 1e-9 relative, phase margin 1e-7 degrees, slope 1e-9; held by tune_test.cpp.
// Differs from the paper: (25) prints a sum of frequency responses where their phases are meant. Its specification (65
// rad/s, 72 degrees, iso-damped) has no solution on its plant: θ = 107°.
// Errors: throws std::invalid_argument quoting the bad value. No solution is a result, not an error.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "control/tuning/design.hpp"
#include "control/tuning/feasible_margins.hpp"

namespace control {

struct TuningResult {
  bool is_feasible = false;
  std::optional<TunedController> tuned;
  std::string reason;                      // if not feasible: one sentence that says why, with its numbers
  double theta_deg = 0, phase_fall = 0;    // θ and R of (2)
  std::optional<TunedController> refused;  // solves (1), but its loop is unstable or another crossover rules it
  // If not feasible, what is: nearest keeps iso-damping or the fixed mu, and offers the nearest phase margin at this
  // crossover and the nearest crossovers below and above for this phase margin, or else the nearest crossover with
  // any phase margin; relaxed keeps crossover and margin. All of them are sound: see is_sound.
  std::vector<TunedController> nearest;
  std::vector<TunedController> relaxed;  // mu fixed; the flattest phase with mu up to 1; mu > 1, named so
};

// The plant's gain must be positive.
TuningResult tune(const FractionalModel& plant, const TuningSpec& spec);

}  // namespace control
