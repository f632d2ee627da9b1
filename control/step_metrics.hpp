// Measures a step response: how fast, how far beyond, how exactly it arrives.
//
// All of it is seen in the direction of the step, from start_m to target_m, over the samples with
// step_at_s ≤ time_s < end_at_s; times count from step_at_s and are those of samples, never interpolated.
//   settling   the first sample after which every sample lies within band_m of the target; none if the last does not
//   overshoot  the furthest excursion beyond the target, in % of the step; 0 if there is none
//   rise       from the first sample beyond 10 % of the step to the first beyond 90 %
//   steady     target less the last sample
// Errors: throws std::invalid_argument quoting the bad value.
#pragma once

#include <limits>
#include <optional>
#include <span>

namespace control {

struct StepExperiment {
  double step_at_s = 0;
  double end_at_s = std::numeric_limits<double>::infinity();
  double start_m = 0;
  double target_m = 0;
  double band_m = 0;  // half the width of the settling band, e.g. 2 % of the step
};

struct StepMetrics {
  std::optional<double> settling_s;
  double overshoot_percent = 0;
  double peak_m = 0;  // the furthest sample in the direction of the step
  std::optional<double> rise_10_90_s;
  double steady_state_error_m = 0;
};

StepMetrics measure_step(std::span<const double> time_s, std::span<const double> position_m,
                         const StepExperiment& experiment);

}  // namespace control
