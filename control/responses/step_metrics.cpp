// Smooths the record if it is noisy, then walks the samples of the step once.
#include "control/responses/step_metrics.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/invalid_argument.hpp"

namespace control {
namespace {

constexpr double kSteadyFraction = 0.1;
constexpr double kIgnoredSds = 2.5;
constexpr double kShortestDwell = 0.05;  // of the record
constexpr double kSdsInBand = 5;         // of the smoothed noise
constexpr double kFewestSmoothed = 5, kMostSmoothed = 21;

template <class... Parts>
[[noreturn]] void refuse(const Parts&... parts) {
  base::throw_invalid("step metrics: ", parts...);
}

void check(std::span<const double> time_s, std::span<const double> position_m, const StepExperiment& experiment) {
  if (time_s.size() != position_m.size()) refuse(time_s.size(), " times but ", position_m.size(), " positions");
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    if (!std::isfinite(time_s[i]) || !std::isfinite(position_m[i]) || (i > 0 && time_s[i] <= time_s[i - 1])) {
      refuse("sample ", i, " (", time_s[i], " s, ", position_m[i], " m) is not finite or not later than the last");
    }
  }
  const double step_m = experiment.target_m - experiment.start_m;
  if (!std::isfinite(step_m) || step_m == 0) {
    refuse("no step from ", experiment.start_m, " m to ", experiment.target_m, " m");
  }
  if (!(experiment.band_m > 0)) refuse("band_m must be positive, is ", experiment.band_m);
  if (!(experiment.noise_sd_m >= 0 && std::isfinite(experiment.noise_sd_m))) {
    refuse("noise_sd_m must be 0 or positive, is ", experiment.noise_sd_m);
  }
}

// Samples that the smoothing of the header takes together.
std::size_t smoothing_length(const StepExperiment& experiment, std::size_t samples) {
  const double ratio = 16 * experiment.noise_sd_m / experiment.band_m;
  const double wanted = std::clamp(ratio * ratio, kFewestSmoothed, kMostSmoothed);
  const auto length = static_cast<std::size_t>(wanted) | 1;  // odd
  return std::min(length, (samples - 1) | 1);
}

// The value at at_s of the least-squares parabola, or straight line, through these points.
double fitted_value(std::span<const double> time_s, std::span<const double> position_m, double at_s, bool is_parabola) {
  const double half_s = (time_s.back() - time_s.front()) / 2 + 1e-300;
  double s0 = 0, s1 = 0, s2 = 0, s3 = 0, s4 = 0, y0 = 0, y1 = 0, y2 = 0;
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    const double t = (time_s[i] - at_s) / half_s, y = position_m[i];
    s0 += 1, s1 += t, s2 += t * t, s3 += t * t * t, s4 += t * t * t * t;
    y0 += y, y1 += t * y, y2 += t * t * y;
  }
  if (!is_parabola) return (y0 * s2 - y1 * s1) / (s0 * s2 - s1 * s1);
  const double minor_0 = s2 * s4 - s3 * s3, minor_1 = s1 * s4 - s2 * s3, minor_2 = s1 * s3 - s2 * s2;
  return (y0 * minor_0 - y1 * minor_1 + y2 * minor_2) / (s0 * minor_0 - s1 * minor_1 + s2 * minor_2);
}

std::vector<double> smoothed(std::span<const double> time_s, std::span<const double> position_m, std::size_t length) {
  const std::size_t samples = time_s.size(), half = length / 2;
  if (length < 3 || samples < length) return {position_m.begin(), position_m.end()};
  std::vector<double> result;
  for (std::size_t i = 0; i < samples; ++i) {
    const std::size_t first = std::min(i < half ? 0 : i - half, samples - length);
    result.push_back(fitted_value(time_s.subspan(first, length), position_m.subspan(first, length), time_s[i],
                                  i == first + half && length >= 5));
  }
  return result;
}

void measure_excursions(std::span<const double> time_s, std::span<const double> position_m,
                        const StepExperiment& experiment, std::size_t fewest_inside, StepMetrics& metrics) {
  const double step_m = experiment.target_m - experiment.start_m;
  std::size_t inside = 0;  // samples since it entered the band
  std::optional<double> settled_at_s, beyond_10_at_s, beyond_90_at_s;
  double furthest = -std::numeric_limits<double>::infinity();  // in steps: 0 at the start, 1 at the target
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    const double travelled = (position_m[i] - experiment.start_m) / step_m;
    if (travelled > furthest) {
      furthest = travelled;
      metrics.peak_time_s = time_s[i] - experiment.step_at_s;
    }
    if (!beyond_10_at_s && travelled >= 0.1) beyond_10_at_s = time_s[i];
    if (!beyond_90_at_s && travelled >= 0.9) beyond_90_at_s = time_s[i];
    if (std::abs(position_m[i] - experiment.target_m) > experiment.band_m) {
      settled_at_s.reset();
      inside = 0;
    } else {
      if (!settled_at_s) settled_at_s = time_s[i];
      ++inside;
    }
  }
  const double dwell_s = kShortestDwell * (time_s.back() - experiment.step_at_s);
  if (settled_at_s && time_s.back() - *settled_at_s >= dwell_s && inside >= fewest_inside) {
    metrics.settling_s = *settled_at_s - experiment.step_at_s;
  }
  if (beyond_90_at_s) metrics.rise_10_90_s = *beyond_90_at_s - *beyond_10_at_s;
  metrics.overshoot_percent = std::max(0.0, 100 * (furthest - 1));
  metrics.peak_m = experiment.start_m + furthest * step_m;
}

void integrate_error(std::span<const double> time_s, std::span<const double> position_m,
                     const StepExperiment& experiment, double ignored_m, StepMetrics& metrics) {
  for (std::size_t i = 1; i < time_s.size(); ++i) {
    const double half_s = (time_s[i] - time_s[i - 1]) / 2;
    for (const std::size_t k : {i - 1, i}) {
      const double error_m = std::abs(experiment.target_m - position_m[k]);
      if (error_m < ignored_m) continue;
      metrics.iae_m_s += half_s * error_m;
      metrics.ise_m2_s += half_s * error_m * error_m;
      metrics.itae_m_s2 += half_s * (time_s[k] - experiment.step_at_s) * error_m;
    }
  }
}

double smoothed_sd_m(const StepExperiment& experiment, std::size_t length) {
  return 1.5 * experiment.noise_sd_m / std::sqrt(static_cast<double>(length));
}

// What is different about a noisy record: position_m is as recorded, metrics are those of the smoothed one.
void allow_for_noise(std::span<const double> position_m, const StepExperiment& experiment, std::size_t length,
                     StepMetrics& metrics) {
  if (kSdsInBand * smoothed_sd_m(experiment, length) > experiment.band_m) metrics.settling_s.reset();
  const auto samples = static_cast<double>(position_m.size());
  const double allowance_m = smoothed_sd_m(experiment, length) * std::sqrt(2 * std::log(samples));
  if (std::abs(metrics.peak_m - experiment.target_m) <= allowance_m) metrics.overshoot_percent = 0;
  const auto last = std::max(length, static_cast<std::size_t>(kSteadyFraction * samples));
  double sum = 0;
  for (const double value : position_m.last(std::min(last, position_m.size()))) sum += experiment.target_m - value;
  metrics.steady_state_error_m = sum / static_cast<double>(std::min(last, position_m.size()));
}

// The samples of the step: index of the first, and count.
std::pair<std::size_t, std::size_t> step_range(std::span<const double> time_s, const StepExperiment& experiment) {
  const auto first = std::ranges::lower_bound(time_s, experiment.step_at_s) - time_s.begin();
  const auto last = std::ranges::lower_bound(time_s, experiment.end_at_s) - time_s.begin();
  if (first >= last) {
    refuse("no sample from ", experiment.step_at_s, " s to before ", experiment.end_at_s, " s");
  }
  return {static_cast<std::size_t>(first), static_cast<std::size_t>(last - first)};
}

}  // namespace

StepMetrics measure_step(std::span<const double> time_s, std::span<const double> position_m,
                         const StepExperiment& experiment) {
  check(time_s, position_m, experiment);
  const auto [first, count] = step_range(time_s, experiment);
  const auto times_s = time_s.subspan(first, count), recorded_m = position_m.subspan(first, count);
  StepMetrics metrics;
  if (experiment.noise_sd_m == 0) {
    measure_excursions(times_s, recorded_m, experiment, 2, metrics);
    integrate_error(times_s, recorded_m, experiment, 0, metrics);
    metrics.steady_state_error_m = experiment.target_m - recorded_m.back();
    return metrics;
  }
  const std::size_t length = smoothing_length(experiment, count);
  const std::vector<double> smooth_m = smoothed(times_s, recorded_m, length);
  measure_excursions(times_s, smooth_m, experiment, length, metrics);
  integrate_error(times_s, smooth_m, experiment, kIgnoredSds * smoothed_sd_m(experiment, length), metrics);
  allow_for_noise(recorded_m, experiment, length, metrics);
  return metrics;
}

StepMetrics measure_step(std::span<const double> time_s, std::span<const double> position_m,
                         std::span<const double> duty, const StepExperiment& experiment) {
  StepMetrics metrics = measure_step(time_s, position_m, experiment);
  if (duty.size() != time_s.size()) refuse(time_s.size(), " times but ", duty.size(), " duties");
  const auto [first, count] = step_range(time_s, experiment);
  double sum = 0;
  for (std::size_t i = first + 1; i < first + count; ++i) sum += std::abs(duty[i] - duty[i - 1]);
  if (!std::isfinite(sum)) refuse("a duty is not finite");
  metrics.duty_total_variation = sum;
  return metrics;
}

}  // namespace control
