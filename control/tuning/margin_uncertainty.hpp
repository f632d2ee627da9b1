// How uncertain crossover, phase margin and phase slope of a loop are, as far as its plant's parameters are.
//
//   g_i = σ_i ∂ln P(jω)/∂q_i,  P = kp/D(s)/s,  s = jω                                       (1)
//         1/kp,  -s^α/D,  -s^β/D,  -b1 s^α ln s/D,  -b2 s^β ln s/D
//   d_i ln ω = -Re g_i/Re S,  d_i φ = Im g_i + Im S d_i ln ω,  S = d ln L/d ln ω            (2)
//   sd² = Σ_ij ρ_ij d_i d_j,  of the phase and (ω σ_T)² of the dead time                    (3)
//   d_i p = (Im g_i' + (Im S' - Im S) d_i ln ω)/ω,  p = Im S/ω,  ' = d/d ln ω               (4)   and σ_T of the dead
//   time
//
// The crossover moves with the gain, and the phase along with it: (2). At an iso-damped crossover Im S is 0, so that an
// error of kp alone costs no margin. First order: true where ln P is nearly straight in the parameters over ±σ.
// Nothing is in it of what no such model describes.
// Accuracy: against draws of plants, held by margin_uncertainty_test.cpp.
// Errors:   none; the arguments have been checked.
#pragma once

#include "control/identification/planned_experiment.hpp"
#include "control/responses/open_loop.hpp"

namespace control {

// One sd of each.
struct MarginUncertainty {
  double phase_margin_deg = 0;
  double gain_crossover_rad_s = 0;
  double phase_slope_deg_per_rad_s = 0;  // of the phase over ω, at the crossover
};

// At this crossover of the loop.
MarginUncertainty margin_uncertainty(const OpenLoop& loop, double gain_crossover_rad_s,
                                     const ExpectedUncertainty& plant);

}  // namespace control
