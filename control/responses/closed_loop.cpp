// Runs the sampled controller against the exactly stepped plant.
#include "control/responses/closed_loop.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "base/invalid_argument.hpp"
#include "control/models/modal_plant.hpp"
#include "control/models/reference_profile.hpp"

namespace control {
namespace {

constexpr double kMostSamples = 1e6;
constexpr double kDiverged = 1e3;
constexpr double kBandFraction = 0.02;

void require(bool is_good, const char* what, double value) {
  if (is_good) return;
  base::throw_invalid("closed loop: ", what, ", is ", value);
}

void check(const ClosedLoopExperiment& e) {
  check(e.plant);
  require(base::is_positive(e.period_s), "period_s must be positive", e.period_s);
  require(base::is_positive(e.duration_s), "duration_s must be positive", e.duration_s);
  require(e.duration_s / e.period_s <= kMostSamples,
          "duration_s must be at most 1e6 periods: shorten it or lengthen period_s", e.duration_s);
  require(std::isfinite(e.setpoint_m), "setpoint_m must be finite", e.setpoint_m);
  require(e.duty_min <= 0, "duty_min must be 0 or negative", e.duty_min);
  require(e.duty_max > 0, "duty_max must be positive", e.duty_max);
  require(std::isfinite(e.disturbance_m), "disturbance_m must be finite", e.disturbance_m);
  require(!std::isnan(e.disturbance_at_s), "disturbance_at_s must be a time", e.disturbance_at_s);
  require(e.noise_sd_m >= 0 && std::isfinite(e.noise_sd_m), "noise_sd_m must be 0 or positive", e.noise_sd_m);
  require(e.settling_band_m >= 0 && std::isfinite(e.settling_band_m),
          "settling_band_m must be positive, or 0 for 2 % of the setpoint", e.settling_band_m);
}

// Index of the first sample at or after a time.
std::size_t sample_at(double time_s, double period_s, std::size_t samples) {
  const double index = std::ceil(time_s / period_s - 1e-6);
  return static_cast<std::size_t>(std::clamp(index, 0.0, static_cast<double>(samples)));
}

double standard_deviation(std::span<const double> values) {
  double mean = 0, sum = 0;
  for (const double value : values) mean += value / static_cast<double>(values.size());
  for (const double value : values) sum += (value - mean) * (value - mean);
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

// The measured position beyond which a loop diverges.
double farthest(const ClosedLoopExperiment& e) {
  const double reach_m = std::max({std::abs(e.setpoint_m), std::abs(e.disturbance_m), e.noise_sd_m});
  return kDiverged * (reach_m > 0 ? reach_m : 1);
}

// Fills in what is measured of the record; true_m is the measured position without its noise.
void measure(const ClosedLoopExperiment& e, std::span<const double> true_m, std::size_t disturbed,
             ClosedLoopPrediction& prediction) {
  const std::size_t last = prediction.time_s.size() - 1;
  const double reach_m = e.setpoint_m != 0 ? e.setpoint_m : e.disturbance_m;
  const double band_m = e.settling_band_m > 0 ? e.settling_band_m : kBandFraction * std::abs(reach_m);
  const std::size_t step_end = std::min(disturbed, last);
  if (e.setpoint_m != 0 && step_end > 0) {
    prediction.step = measure_step(prediction.time_s, true_m, prediction.duty,
                                   {0, prediction.time_s[step_end], 0, e.setpoint_m, band_m});
  }
  if (e.disturbance_m != 0 && disturbed < last) {
    prediction.disturbance = measure_step(
        prediction.time_s, true_m, prediction.duty,
        {prediction.time_s[disturbed], prediction.time_s[last], e.setpoint_m + e.disturbance_m, e.setpoint_m, band_m});
  }
  if (prediction.is_diverging) prediction.step.settling_s = prediction.disturbance.settling_s = std::nullopt;
  const std::size_t rest = 3 * step_end / 4;
  prediction.duty_sd_at_rest = standard_deviation(std::span(prediction.duty).subspan(rest, step_end - rest));
}

}  // namespace

ClosedLoopPrediction predict_closed_loop(const ClosedLoopExperiment& e) {
  check(e);
  const auto samples = static_cast<std::size_t>(std::lround(e.duration_s / e.period_s)) + 1;
  const std::size_t disturbed = sample_at(e.disturbance_at_s, e.period_s, samples);
  const ReferenceProfile profile{e.setpoint_m, e.profile_velocity_m_s, e.profile_acceleration_m_s2};
  ModalPlant plant{e.plant, e.period_s};
  SectionFilter controller{e.controller};
  std::mt19937_64 generator{e.noise_seed};
  std::normal_distribution<double> unit_noise;
  ClosedLoopPrediction prediction;
  std::vector<double> true_m;
  std::size_t clipped = 0;
  const double farthest_m = farthest(e);
  for (std::size_t k = 0; k < samples && !prediction.is_diverging; ++k) {
    const double time_s = static_cast<double>(k) * e.period_s, reference_m = profile.position_m(time_s);
    true_m.push_back(plant.position_m() + (k >= disturbed ? e.disturbance_m : 0));
    const double measured_m = true_m.back() + (e.noise_sd_m > 0 ? e.noise_sd_m * unit_noise(generator) : 0);
    const double wanted = controller.step(reference_m - measured_m);  // (1)
    const double duty = std::clamp(wanted, e.duty_min, e.duty_max);
    clipped += duty == wanted ? 0 : 1;
    prediction.time_s.push_back(time_s);
    prediction.position_m.push_back(plant.position_m());
    prediction.velocity_m_s.push_back(plant.velocity_m_s());
    prediction.measured_m.push_back(measured_m);
    prediction.duty.push_back(duty);
    prediction.reference_m.push_back(reference_m);
    plant.step(duty);  // (2)
    prediction.is_diverging = !(std::abs(measured_m) <= farthest_m);
  }
  prediction.clipped_fraction = static_cast<double>(clipped) / static_cast<double>(true_m.size());
  measure(e, true_m, disturbed, prediction);
  return prediction;
}

}  // namespace control
