// Measures a step response: how fast, how far beyond, how exactly it arrives.
//
// All of it is seen in the direction of the step, from start_m to target_m, over the samples with
// step_at_s ≤ time_s < end_at_s; times count from step_at_s and are those of samples, never interpolated.
//   settling   the first sample after which every sample lies within band_m of the target; none if the last does not,
//              or if that stretch is shorter than 5 % of the record: an oscillation is inside the band now and then
//   overshoot  the furthest excursion beyond the target, in % of the step; 0 if there is none
//   rise       from the first sample beyond 10 % of the step to the first beyond 90 %
//   steady     target less the last sample
//   IAE, ISE, ITAE   ∫|e|, ∫e², ∫t|e| of e = target - position, by the trapezoidal rule
//   total variation  Σ|u_k - u_{k-1}| of the duty, if there is one
//
// With noise_sd_m > 0 the record is smoothed first: each sample becomes the value of the parabola fitted to the
// m = (16 sd/band)² samples around it, 5 ≤ m ≤ 21 (near the ends, of the straight line through the m first or last
// samples). It follows slope and curvature, so it does not lag, but a peak narrower than m samples comes out lower;
// noise of sd becomes 1.5 sd/√m. All measures but the total variation are those of the smoothed record, and
//   settling   needs a stretch of m samples, too, and is none if 5 · 1.5 sd/√m is more than the band: then the noise
//              that is left may leave the band at any time, and where it last did says nothing of the response
//   overshoot  is 0 unless beyond 1.5 sd √(2 ln n)/√m, which noise alone reaches among n samples
//   IAE, ISE, ITAE count errors below 2.5 · 1.5 sd/√m as 0, or they would grow with the length of the record
//   steady     is the mean over the last tenth of the samples
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
  double band_m = 0;      // half the width of the settling band, e.g. 2 % of the step
  double noise_sd_m = 0;  // of white noise on the position; 0: every sample is taken at its word
};

struct StepMetrics {
  std::optional<double> settling_s;
  double overshoot_percent = 0;
  double peak_m = 0;  // the furthest sample in the direction of the step
  std::optional<double> rise_10_90_s;
  double steady_state_error_m = 0;
  double peak_time_s = 0;  // of peak_m
  double iae_m_s = 0;
  double ise_m2_s = 0;
  double itae_m_s2 = 0;
  std::optional<double> duty_total_variation;  // only if the duty is given
};

StepMetrics measure_step(std::span<const double> time_s, std::span<const double> position_m,
                         const StepExperiment& experiment);
StepMetrics measure_step(std::span<const double> time_s, std::span<const double> position_m,
                         std::span<const double> duty, const StepExperiment& experiment);

}  // namespace control
