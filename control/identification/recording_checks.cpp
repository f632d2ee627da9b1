// Each refusal names the column, the value and what to do.
#include "control/identification/recording_checks.hpp"

#include <algorithm>
#include <cmath>

#include "base/invalid_argument.hpp"
#include "control/search/fit_statistics.hpp"
#include "control/search/missed_ticks.hpp"

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

}  // namespace

void check_recording(const Recording& recording) {
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
  if (!recording.is_missed.empty() && recording.is_missed.size() != samples) {
    refuse("is_missed has ", recording.is_missed.size(), " values, duty has ", samples, ": give one per sample");
  }
  if (!recording.is_left_out.empty() && recording.is_left_out.size() != samples) {
    refuse("is_left_out has ", recording.is_left_out.size(), " values, duty has ", samples, ": give one per sample");
  }
  if (!recording.position_time_s.empty()) check_own_times(recording);
  if (!recording.position_sd_m.empty()) check_own_sds(recording);
  const std::size_t positions = recording.position_time_s.empty() ? samples : recording.position_time_s.size();
  check_output("position_m", recording.position_m, positions);
  check_output("velocity_m_s", recording.velocity_m_s, samples);
  check_output("acceleration_m_s2", recording.acceleration_m_s2, samples);
}

void check_options(const IdentificationOptions& options, const Recording& recording) {
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

namespace {

// Before samples are placed at their ticks, which reads every column as far as time_s goes.
void check_size(const char* name, std::span<const double> values, std::size_t samples) {
  if (values.empty() || values.size() == samples) return;
  refuse(name, " has ", values.size(), " values, time_s has ", samples, ": give one per sample, or none");
}

struct Ticks {
  double dt_s = 0;
  std::vector<std::size_t> tick;  // of each sample
};

// The usual step is the middle one, which holes cannot move; every other step is a whole number of it.
Ticks ticks_of(std::span<const double> time_s) {
  std::vector<double> steps_s;
  for (std::size_t k = 1; k < time_s.size(); ++k) steps_s.push_back(time_s[k] - time_s[k - 1]);
  const double usual_s = median(steps_s);
  if (!(usual_s > 0)) refuse("time_s must increase, its middle step is ", usual_s);
  Ticks at{usual_s, {0}};
  for (std::size_t k = 1; k < time_s.size(); ++k) {
    const double step_s = steps_s[k - 1], ticks = std::round(step_s / usual_s);
    if (!(ticks >= 1 && std::abs(step_s - ticks * usual_s) <= kEqualSteps * usual_s)) {
      refuse("time_s steps by ", step_s, " s to sample ", k, ", and usually by ", usual_s,
             " s: resample to equal steps, within 1 %; only whole steps may be missing");
    }
    if (ticks - 1 > most_missed_in_a_row(usual_s)) {
      refuse("time_s steps by ", step_s, " s to sample ", k, ": ", ticks - 1, " steps of ", usual_s,
             " s are missing, more than ", kLongestMissedS, " s in a row; cut the record there");
    }
    at.tick.push_back(at.tick.back() + static_cast<std::size_t>(ticks));
  }
  const std::size_t all = at.tick.back() + 1, missed = all - time_s.size();
  if (!may_be_missed(missed, all)) {
    refuse("time_s lacks ", missed, " of ", all, " steps, more than ", 100 * kMostMissedShare,
           " %: cut out a part that has fewer holes");
  }
  at.dt_s = (time_s.back() - time_s.front()) / static_cast<double>(at.tick.back());
  return at;
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
  check_size("position_m", position_m, samples);
  check_size("velocity_m_s", velocity_m_s, samples);
  check_size("acceleration_m_s2", acceleration_m_s2, samples);
  const Ticks at = ticks_of(time_s);
  Recording recording{at.dt_s,
                      {duty.begin(), duty.end()},
                      {position_m.begin(), position_m.end()},
                      {velocity_m_s.begin(), velocity_m_s.end()},
                      {acceleration_m_s2.begin(), acceleration_m_s2.end()}};
  place_at_ticks(recording, at.tick);
  check_recording(recording);
  return recording;
}

}  // namespace control
