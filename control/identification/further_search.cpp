// Searches again, with other options or other duties.
#include "control/identification/further_search.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "control/search/search_limit.hpp"

namespace control {
namespace {

constexpr double kLongestTriedS = 0.2;  // of dead times that nobody named

using Watcher = std::function<bool(const Progress&)>;

// The watcher of a search for that purpose, which it learns at once.
Watcher watcher_for(bool Progress::* purpose, const Watcher& on_progress) {
  if (!on_progress) return {};
  const auto marked = [purpose, on_progress](Progress progress) {
    progress.*purpose = true;
    return on_progress(progress);
  };
  const bool goes_on = marked({});
  return [goes_on, marked](const Progress& progress) { return goes_on && marked(progress); };
}

bool has_ended(const Fit& fit) { return fit.end == SearchEnd::converged || fit.end == SearchEnd::iteration_limit; }

// Logarithm of the residuals' sd by that of the other fit, in the mean over the values of all runs.
double relative_sd(const Identification& one, const Identification& other, std::span<const Recording> recordings) {
  if (one.runs.empty()) return std::log(one.best.residual_sd / other.best.residual_sd);
  double sum = 0, values = 0;
  for (std::size_t i = 0; i < one.runs.size(); ++i) {
    const auto of_run = static_cast<double>(recordings[i].duty.size());
    sum += of_run * std::log(one.runs[i].fit.residual_sd / other.runs[i].fit.residual_sd);
    values += of_run;
  }
  return sum / values;
}

}  // namespace

IdentificationOptions with_dead_time(IdentificationOptions options, const Recording& shortest, double left_s) {
  const double duration_s = shortest.dt_s * static_cast<double>(shortest.duty.size());
  options.longest_dead_time_s = std::min(kLongestTriedS, duration_s / 4);
  options.time_limit_s = left_s;
  options.on_progress = watcher_for(&Progress::is_for_dead_time, options.on_progress);
  return options;
}

Identification with_own_dead_zone(std::span<const Recording> recordings, const IdentificationOptions& options,
                                  const Searching& search) {
  const double deadline_s = steady_now_s() + options.time_limit_s;
  Identification found = search(recordings, options);
  if (!found.dead_zone) return found;
  const DeadZone zone = *std::exchange(found.dead_zone, std::nullopt);
  std::vector<Recording> driven(recordings.begin(), recordings.end());
  for (Recording& one : driven) one.duty = beyond_dead_zone(std::move(one.duty), zone);
  IdentificationOptions without_its_duties = options;
  without_its_duties.time_limit_s = deadline_s - steady_now_s();
  without_its_duties.on_progress = watcher_for(&Progress::is_for_dead_zone, options.on_progress);
  Identification beyond = search(driven, without_its_duties);
  if (beyond.best.end == SearchEnd::time_limit) return beyond;
  const bool is_better = has_ended(beyond.best) && relative_sd(beyond, found, recordings) < 0;
  if (!is_better || changes_with_amplitude(beyond.amplitude)) return found;
  beyond.dead_zone = zone;
  beyond.doubts.push_back({DoubtCode::dead_zone, zone.from_duty});
  beyond.warnings.push_back(dead_zone_in_words(zone));
  return beyond;
}

}  // namespace control
