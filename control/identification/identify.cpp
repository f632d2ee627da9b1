// Checks the recording, fits the structures asked for, compares them and words the doubts.
#include "control/identification/identify.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <sstream>
#include <tuple>
#include <utility>

#include "base/invalid_argument.hpp"
#include "control/identification/amplitude_doubt.hpp"
#include "control/identification/fit_summary.hpp"
#include "control/identification/identifiability.hpp"
#include "control/identification/residual_doubts.hpp"
#include "control/identification/second_opinions.hpp"
#include "control/search/output_error_search.hpp"

namespace control {
namespace {

constexpr std::size_t kFewestSamples = 20;
constexpr double kEqualSteps = 0.01;
constexpr double kShortestStepS = 1e-6, kLongestStepS = 1e4;
constexpr double kLargestDuty = 1e3, kSmallestDuty = 1e-9;
constexpr double kLargestOutput = 1e50, kSmallestSpread = 1e-50;  // so that squares and their sums are finite

template <typename... Parts>
[[noreturn]] void refuse(const Parts&... parts) {
  base::throw_invalid("identification: ", parts...);
}

void check_column(const char* name, std::span<const double> values, std::size_t expected) {
  if (values.size() != expected) {
    refuse(name, " has ", values.size(), " values, duty has ", expected, ": give one per sample, or none");
  }
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (!std::isfinite(values[k])) refuse(name, '[', k, "] is ", values[k], ": remove or repair it");
  }
}

void check_output(const char* name, std::span<const double> values, std::size_t expected) {
  if (values.empty()) return;
  check_column(name, values, expected);
  if (std::ranges::all_of(values, [&](double value) { return value == values.front(); })) {
    refuse(name, " is ", values.front(), " throughout: record a run in which the robot moves");
  }
  const auto [least, most] = std::ranges::minmax(values);
  const double largest = std::abs(least) > most ? least : most;
  if (std::abs(largest) > kLargestOutput) {
    refuse(name, " reaches ", largest, ", beyond ", kLargestOutput, ": give it in metres and seconds");
  }
  if (!(most - least > kSmallestSpread)) {
    refuse(name, " varies by ", most - least, " only, below ", kSmallestSpread, ": give it in metres and seconds");
  }
}

void check_duty(const std::vector<double>& duty) {
  check_column("duty", duty, duty.size());
  double largest = 0;
  for (std::size_t k = 0; k < duty.size(); ++k) {
    if (std::abs(duty[k]) > kLargestDuty) {
      refuse("duty[", k, "] is ", duty[k], ", beyond ", kLargestDuty, ": give it from -1 to 1");
    }
    if (k + 1 < duty.size()) largest = std::max(largest, std::abs(duty[k]));
  }
  if (largest == 0) {
    refuse("duty is 0 throughout, which excites nothing: record a run with a step or a changing duty");
  }
  if (largest < kSmallestDuty) {
    refuse("duty is at most ", largest, ", below ", kSmallestDuty, ", which excites nothing: give it from -1 to 1");
  }
}

void check_own_times(const Recording& recording) {
  const std::vector<double>& time_s = recording.position_time_s;
  if (recording.position_m.empty() || !recording.velocity_m_s.empty()) {
    refuse("position_time_s belongs to a position_m that was measured alone");
  }
  if (time_s.size() != recording.position_m.size()) {
    refuse("position_m has ", recording.position_m.size(), " values, position_time_s has ", time_s.size(),
           ": give one per time");
  }
  if (time_s.size() < kFewestSamples) {
    refuse("position_time_s has ", time_s.size(), " times: measure at least ", kFewestSamples, " positions");
  }
  const double end_s = recording.dt_s * static_cast<double>(recording.duty.size() - 1);
  for (std::size_t k = 0; k < time_s.size(); ++k) {
    if (!(time_s[k] >= 0 && time_s[k] <= end_s)) {
      refuse("position_time_s[", k, "] is ", time_s[k], ": it must lie in the record, from 0 to ", end_s, " s");
    }
    if (k > 0 && !(time_s[k] > time_s[k - 1])) {
      refuse("position_time_s[", k, "] is ", time_s[k], ", not after the one before: times must ascend");
    }
  }
}

void check_own_sds(const Recording& recording) {
  const std::vector<double>& sd_m = recording.position_sd_m;
  if (sd_m.size() != recording.position_time_s.size()) {
    refuse("position_sd_m has ", sd_m.size(), " values, position_time_s has ", recording.position_time_s.size(),
           ": give one per time, or none");
  }
  for (std::size_t k = 0; k < sd_m.size(); ++k) {
    if (!(sd_m[k] > 0 && std::isfinite(sd_m[k]))) refuse("position_sd_m[", k, "] is ", sd_m[k], ", not positive");
  }
}

void check(const Recording& recording) {
  const std::size_t samples = recording.duty.size();
  if (!(recording.dt_s > 0)) refuse("dt_s must be positive, is ", recording.dt_s);
  if (!(recording.dt_s >= kShortestStepS && recording.dt_s <= kLongestStepS)) {
    refuse("dt_s must be from ", kShortestStepS, " to ", kLongestStepS, ", is ", recording.dt_s,
           ": give it in seconds");
  }
  if (samples < kFewestSamples) refuse("duty has ", samples, " samples: record at least ", kFewestSamples);
  if (samples > kMostSamples) {
    refuse("duty has ", samples, " samples, more than ", kMostSamples, ": cut the run or sample it more slowly");
  }
  const bool has_motion = !recording.position_m.empty() || !recording.velocity_m_s.empty();
  if (has_motion == !recording.acceleration_m_s2.empty()) {
    refuse(has_motion ? "acceleration_m_s2 is given beside position_m or velocity_m_s: give it alone, or not at all"
                      : "position_m, velocity_m_s and acceleration_m_s2 are all empty: give one of them");
  }
  check_duty(recording.duty);
  if (!recording.position_time_s.empty()) check_own_times(recording);
  if (!recording.position_sd_m.empty()) check_own_sds(recording);
  const std::size_t positions = recording.position_time_s.empty() ? samples : recording.position_time_s.size();
  check_output("position_m", recording.position_m, positions);
  check_output("velocity_m_s", recording.velocity_m_s, samples);
  check_output("acceleration_m_s2", recording.acceleration_m_s2, samples);
}

void check(const IdentificationOptions& options, const Recording& recording) {
  const double longest_s = options.longest_dead_time_s;
  const double half_s = recording.dt_s * static_cast<double>(recording.duty.size() - 1) / 2;
  if (!(longest_s >= 0 && longest_s <= half_s)) {
    refuse("longest_dead_time_s must be from 0 to half the record, ", half_s, ", is ", longest_s);
  }
  if (options.sensor_lag_s && recording.acceleration_m_s2.empty()) {
    refuse("sensor_lag_s belongs to an acceleration, and none is fitted: leave it away");
  }
  if (options.sensor_lag_s && !(*options.sensor_lag_s >= 0 && *options.sensor_lag_s <= half_s)) {
    refuse("sensor_lag_s must be from 0 to half the record, ", half_s, ", is ", *options.sensor_lag_s);
  }
  if (!(options.time_limit_s > 0)) refuse("time_limit_s must be positive, is ", options.time_limit_s);
  if (options.iteration_limit < 1) refuse("iteration_limit must be at least 1, is ", options.iteration_limit);
  if (options.further_starts < 0 || options.further_starts > 1000) {
    refuse("further_starts must be from 0 to 1000, is ", options.further_starts);
  }
}

// The least AIC among those searched, first. The AIC of an unfinished one is an upper bound: so it may win, but where
// it does not it is not ranked, and stands after the finished ones.
void put_best_first(std::vector<Fit>& fits) {
  const auto key = [](const Fit& fit) { return std::pair(fit.aic, fit.free_parameters); };
  std::ranges::sort(fits, {}, [&](const Fit& fit) { return std::tuple(fit.starts == 0, key(fit)); });
  std::ranges::sort(fits.begin() + 1, fits.end(), {}, [&](const Fit& fit) {
    return std::tuple(fit.starts == 0, fit.end != SearchEnd::converged, key(fit));
  });
}

std::vector<std::string> untried_structures(const std::vector<Fit>& fits) {
  std::vector<std::string> warnings;
  for (const Fit& fit : std::span(fits).subspan(1)) {
    if (fit.end == SearchEnd::converged) continue;
    const std::string name = structure_name(fit.structure);
    warnings.push_back(
        fit.starts == 0 ? base::join_text("the ", name, " model was not tried, since the search ", end_words(fit.end),
                                          ": the one given may not be the best of the structures; raise the limit")
                        : base::join_text("the search for the ", name, " model ", end_words(fit.end), " after ",
                                          fit.starts, fit.starts == 1 ? " start" : " starts",
                                          ": it may be better than it looks, and is not compared; raise the limit"));
  }
  return warnings;
}

// Only finished searches can say that something is not needed.
void add_verdict(const std::vector<Fit>& fits, std::vector<std::string>& warnings) {
  const Fit& best = fits.front();
  for (const Fit& fit : std::span(fits).subspan(1)) {
    if (fit.structure != Structure::fractional || fit.end != SearchEnd::converged) continue;
    std::ostringstream text;
    text.precision(3);
    text << "this run does not call for fractional orders: the AIC of the " << structure_name(best.structure)
         << " model is lower by " << fit.aic - best.aic
         << "; a duty that changes faster, less noise or a longer run would tell them apart if they are there";
    warnings.push_back(text.str());
  }
}

// A sigma is that of a linearised model at the optimum: where the cost is flat away from it, it comes out too small.
// What says so is a model with whole orders whose AIC is hardly higher; one that is higher by 10 has no support
// (Burnham and Anderson 2002, 2.6).
void add_rival(const std::vector<Fit>& fits, std::vector<std::string>& warnings) {
  constexpr double kNoSupport = 10;
  const Fit& best = fits.front();
  if (best.structure != Structure::fractional || fits.size() < 2) return;
  const Fit& rival = fits[1];  // the best of the others, if its search is finished
  if (rival.end != SearchEnd::converged || !(rival.aic - best.aic < kNoSupport)) return;
  std::ostringstream text;
  text.precision(2);
  text << "this run cannot determine whether the orders are fractional, so alpha and beta are open: the AIC of the "
       << structure_name(rival.structure) << " model is higher by " << rival.aic - best.aic
       << " only (10 would rule it out), whatever their sigmas say; let the duty change faster, during a longer run";
  warnings.push_back(text.str());
}

// Of least squares; its slope is the weight of each position.
double best_offset_m(OutputErrorSearch& search, const SearchPoint& point) {
  const std::vector<int> free = search.free_parameters(Structure::fractional);
  const auto at = std::ranges::find(free, kOffset);
  const Eigen::VectorXd slope = search.jacobians(Structure::fractional, point).front().col(at - free.begin());
  return slope.dot(search.residuals(point).front()) / slope.squaredNorm();
}

}  // namespace

Recording make_recording(std::span<const double> time_s, std::span<const double> duty,
                         std::span<const double> position_m, std::span<const double> velocity_m_s,
                         std::span<const double> acceleration_m_s2) {
  const std::size_t samples = time_s.size();
  if (samples < kFewestSamples) refuse("time_s has ", samples, " samples: record at least ", kFewestSamples);
  check_column("time_s", time_s, samples);
  if (duty.size() != samples)
    refuse("duty has ", duty.size(), " values, time_s has ", samples, ": give one per sample");
  const double dt_s = (time_s.back() - time_s.front()) / static_cast<double>(samples - 1);
  if (!(dt_s > 0)) refuse("time_s must increase, its mean step is ", dt_s);
  for (std::size_t k = 1; k < samples; ++k) {
    const double step_s = time_s[k] - time_s[k - 1];
    if (!(std::abs(step_s - dt_s) <= kEqualSteps * dt_s)) {
      refuse("time_s steps by ", step_s, " s to sample ", k, " and by ", dt_s,
             " s in the mean: resample to equal steps, within 1 %");
    }
  }
  Recording recording{dt_s,
                      {duty.begin(), duty.end()},
                      {position_m.begin(), position_m.end()},
                      {velocity_m_s.begin(), velocity_m_s.end()},
                      {acceleration_m_s2.begin(), acceleration_m_s2.end()}};
  check(recording);
  return recording;
}

Identification identify(const Recording& recording, const IdentificationOptions& options) {
  check(recording);
  check(options, recording);
  OutputErrorSearch search(recording, options);
  std::vector<Structure> structures{Structure::first_order, Structure::second_order, Structure::fractional};
  if (options.structure) structures = {*options.structure};

  if (!recording.acceleration_m_s2.empty()) search.find_sensor(static_cast<int>(structures.size()) + 1);
  Identification result;
  std::map<Structure, SearchPoint> points;
  int left = static_cast<int>(structures.size());
  for (const Structure structure : structures) {
    const SearchResult found = search.run(structure, left--);
    points[structure] = found.point;
    result.compared.push_back(summary(search, recording, options.cost, structure, found));
  }
  put_best_first(result.compared);
  result.best = result.compared.front();
  result.amplitude = amplitude_evidence(search, recording, result.best, points[result.best.structure]);
  std::vector<std::string>& warnings = result.warnings;
  const auto add = [&](std::vector<std::string> more) { std::ranges::move(more, std::back_inserter(warnings)); };
  add(search_doubts(result.best, options));  // causes first, then what follows from them
  add(sensor_doubts(search));
  add(lag_doubts(recording, options, result.best));
  add(untried_structures(result.compared));
  add(second_opinions(search, recording, options, result.best));
  const bool order_is_forced = options.structure && *options.structure != Structure::fractional;
  add(amplitude_doubts(result.amplitude, recording, order_is_forced));
  add(residual_doubts(recording, options, result.best));
  add(identifiability_warnings(recording, result.best, options));
  add_verdict(result.compared, warnings);
  add_rival(result.compared, warnings);
  return result;
}

Fit evaluate(const FractionalModel& model, const Recording& recording, const IdentificationOptions& options) {
  check(recording);
  IdentificationOptions fixed = options;
  fixed.structure = Structure::fractional;
  fixed.longest_dead_time_s = model.dead_time_s;  // so that the output can be as late
  check(fixed, recording);
  OutputErrorSearch search(recording, fixed);
  if (!recording.acceleration_m_s2.empty()) search.find_sensor(1);
  SearchResult found;
  found.point = search.start(Structure::fractional, 0);
  found.point.model = normalised(model);
  found.point.offset_m = 0;
  if (search.channels().front() == Channel::position && options.fits_offset) {
    found.point.offset_m = best_offset_m(search, found.point);
  }
  found.end = search.sensor_search_end().value_or(SearchEnd::converged);
  Fit fit = summary(search, recording, options.cost, Structure::fractional, found);
  fit.one_sigma = {};
  fit.correlation = {};
  return fit;
}

}  // namespace control
