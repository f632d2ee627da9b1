// Walks the samples of the step once.
#include "control/step_metrics.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace control {
namespace {

template <class... Parts>
[[noreturn]] void refuse(const Parts&... parts) {
  std::ostringstream text;
  text << "step metrics: ";
  (text << ... << parts);
  throw std::invalid_argument(text.str());
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
}

}  // namespace

StepMetrics measure_step(std::span<const double> time_s, std::span<const double> position_m,
                         const StepExperiment& experiment) {
  check(time_s, position_m, experiment);
  const auto first = std::ranges::lower_bound(time_s, experiment.step_at_s) - time_s.begin();
  const auto last = std::ranges::lower_bound(time_s, experiment.end_at_s) - time_s.begin();
  if (first >= last) {
    refuse("no sample from ", experiment.step_at_s, " s to before ", experiment.end_at_s, " s");
  }
  const double step_m = experiment.target_m - experiment.start_m;
  std::optional<double> settled_at_s, beyond_10_at_s, beyond_90_at_s;
  double furthest = -std::numeric_limits<double>::infinity();  // in steps: 0 at the start, 1 at the target
  for (auto i = static_cast<std::size_t>(first); i < static_cast<std::size_t>(last); ++i) {
    const double travelled = (position_m[i] - experiment.start_m) / step_m;
    furthest = std::max(furthest, travelled);
    if (!beyond_10_at_s && travelled >= 0.1) beyond_10_at_s = time_s[i];
    if (!beyond_90_at_s && travelled >= 0.9) beyond_90_at_s = time_s[i];
    if (std::abs(position_m[i] - experiment.target_m) > experiment.band_m) {
      settled_at_s.reset();
    } else if (!settled_at_s) {
      settled_at_s = time_s[i];
    }
  }
  StepMetrics metrics;
  if (settled_at_s) metrics.settling_s = *settled_at_s - experiment.step_at_s;
  if (beyond_90_at_s) metrics.rise_10_90_s = *beyond_90_at_s - *beyond_10_at_s;
  metrics.overshoot_percent = std::max(0.0, 100 * (furthest - 1));
  metrics.peak_m = experiment.start_m + furthest * step_m;
  metrics.steady_state_error_m = experiment.target_m - position_m[static_cast<std::size_t>(last) - 1];
  return metrics;
}

}  // namespace control
