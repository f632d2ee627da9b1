// Tunes the fractional PD controller to a plant that was measured at the crossover, without a model: (24) to (26) ask
// for modulus, phase and phase slope there, and for nothing else.
//
//   θ = -π + φ_m - arg P,  R = -d arg P/d ln ω,  |P|     measured: control/tuning/three_tones
//   then (3) to (6) of tune.hpp
//
// What the loop does elsewhere is known at the other two tones only: a design is refused if the loop's gain is not
// above 1 at the lower tone and below 1 at the upper, because it would cross over there. Whether it crosses again
// further up stays unknown, as does the stability of the closed loop; a model tells.
//
// Errors: throws std::invalid_argument quoting the bad value. No solution is a result, not an error.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "control/tuning/design.hpp"
#include "control/tuning/three_tones.hpp"

namespace control {

// A specification at the measured crossover that has a solution, and its controller.
struct MeasuredOffer {
  std::string name;  // in words: what was kept and what was given up
  TuningSpec spec;   // tuning to this returns this controller
  FopdController controller;
};

struct MeasuredTuning {
  std::optional<FopdController> controller;
  std::string reason;  // if there is none
  // If there is none, what is, as tune offers it at the crossover that was measured: the nearest phase margin,
  // iso-damped or with the fixed mu, and this phase margin with another mu. Empty where the plant was not measured.
  std::vector<MeasuredOffer> nearest, relaxed;
  double theta_deg = 0, phase_fall = 0;  // θ and R
  // One sigma of what is achieved: that of the measurement, with the errors of the method that three_tones.hpp states,
  // the largest of ten fluids, in quadrature.
  double phase_margin_sigma_deg = 0, crossover_sigma_rad_s = 0;
  double phase_slope_sigma_deg_per_rad_s = 0;
};

// The crossover of `spec` is the one that was measured. With its mu iso-damping is dropped, as in tune.
MeasuredTuning tune_measured(const MeasuredPlant& plant, const TuningSpec& spec);

}  // namespace control
