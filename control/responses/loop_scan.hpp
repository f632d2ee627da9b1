// The open loop along the imaginary axis, sampled as densely as it bends and over all frequencies that matter.
//
// The frequencies worth searching follow from where the terms of D and C are equal and from the asymptotes of |L|, so
// that time constants of milliseconds and of hours are alike. A dead time T turns L by ωT: the samples follow the turns
// while |L| is not small for good, as far as ωT = kMostTurnsRad. Beyond it L turns so fast that its envelope, |L|, is
// all that counts.
// Errors: none; the arguments have been checked.
#pragma once

#include <vector>

#include "control/responses/frequency_response.hpp"
#include "control/responses/open_loop.hpp"

namespace control {

constexpr double kTurnStepRad = 0.25;   // of a dead time's phase, from sample to sample
constexpr double kMostTurnsRad = 2000;  // of the same

class LoopOnAxis {
 public:
  explicit LoopOnAxis(const OpenLoop& loop) : plant_{loop.plant, loop.is_velocity_loop}, controller_{loop.controller} {}
  AxisPoint at(double log_omega) const { return plant_.at(log_omega) * controller_.at(log_omega); }

 private:
  PlantOnAxis plant_;
  ControllerOnAxis controller_;
};

struct Sample {
  double log_omega = 0;
  AxisPoint loop;
};

// How |L| ends on the right: |L| → e^log_gain · ω^slope.
struct Asymptote {
  double log_gain = 0, slope = 0;
};

Asymptote right_asymptote(const OpenLoop& loop);
double log_dc_gain(const OpenLoop& loop);  // of the loop without its integrator

// Ascending.
std::vector<Sample> scan(const OpenLoop& loop, const LoopOnAxis& on_axis);

}  // namespace control
