// One pass for the distances of samples, one for what they say.
#include "server/analysis/metrics/run_figures.hpp"

#include <algorithm>
#include <cmath>

namespace server::analysis {
namespace {

constexpr double kFullPower = 0.9;  // as in the abort criteria of profiles

bool follows(const RunPoint& before, const RunPoint& after) {
  return before.step.span == after.step.span && after.step.seq == before.step.seq + 1;
}

double seconds_between(const RunPoint& before, const RunPoint& after) {
  return 1e-6 * static_cast<double>(after.step.robot_time_us - before.step.robot_time_us);
}

// The median, which gaps and skipped periods cannot move.
double usual_period_s(std::span<const RunPoint> points) {
  std::vector<double> steps_s;
  for (std::size_t i = 1; i < points.size(); ++i) {
    if (follows(points[i - 1], points[i])) steps_s.push_back(seconds_between(points[i - 1], points[i]));
  }
  if (steps_s.empty()) return 0;
  const auto middle = steps_s.begin() + static_cast<std::ptrdiff_t>(steps_s.size() / 2);
  std::ranges::nth_element(steps_s, middle);
  return *middle;
}

struct Gaps {
  double count = 0, longest_s = 0;
};

Gaps gaps_in(std::span<const RunPoint> points) {
  Gaps gaps;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const bool same_span = points[i - 1].step.span == points[i].step.span;
    if (!same_span || follows(points[i - 1], points[i])) continue;
    ++gaps.count;
    gaps.longest_s = std::max(gaps.longest_s, seconds_between(points[i - 1], points[i]));
  }
  return gaps;
}

// The longest time for which `holds`, without a gap.
template <class Holds>
double longest_s(std::span<const RunPoint> points, double period_s, Holds holds) {
  double longest = 0, now = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i > 0 && !follows(points[i - 1], points[i])) now = 0;
    now = holds(points[i]) ? now + period_s : 0;
    longest = std::max(longest, now);
  }
  return longest;
}

template <class Holds>
double share(std::span<const RunPoint> points, Holds holds) {
  if (points.empty()) return 0;
  return static_cast<double>(std::ranges::count_if(points, holds)) / static_cast<double>(points.size());
}

auto has_flag(std::uint32_t flag) {
  return [flag](const RunPoint& point) { return (point.flags & flag) != 0; };
}

std::optional<double> duty_rms(std::span<const RunPoint> points) {
  double squares = 0, count = 0;
  for (const RunPoint& point : points) {
    if (!std::isfinite(point.duty)) continue;
    squares += static_cast<double>(point.duty) * static_cast<double>(point.duty);
    ++count;
  }
  return count > 0 ? std::optional{std::sqrt(squares / count)} : std::nullopt;
}

// Of the positions that are numbers.
template <class Value>
std::optional<std::pair<double, double>> range_of(std::span<const RunPoint> points, Value value) {
  std::optional<std::pair<double, double>> range;
  for (const RunPoint& point : points) {
    const auto number = static_cast<double>(point.step.*value);
    if (!std::isfinite(number)) continue;
    if (!range) range.emplace(number, number);
    range->first = std::min(range->first, number);
    range->second = std::max(range->second, number);
  }
  return range;
}

}  // namespace

RunPoint run_point(const storage::StoredSample& stored) {
  return {step_point(stored), stored.sample.duty, stored.flags, stored.emergency_id != 0};
}

Figures run_figures(std::span<const RunPoint> points, const storage::Run& run) {
  const double period_s = usual_period_s(points);
  const Gaps gaps = gaps_in(points);
  const auto at_power = [](const RunPoint& point) { return std::abs(point.duty) > kFullPower; };
  const auto is_driven = [](const RunPoint& point) { return std::abs(point.duty) > 0; };
  const auto is_latched = [](const RunPoint& point) { return point.is_latched; };
  const auto positions = range_of(points, &StepPoint::position_m);
  const auto sds = range_of(points, &StepPoint::position_sd_m);
  return {
      {"duration_s", period_s * static_cast<double>(points.size())},
      {"samples_expected", static_cast<double>(run.samples_expected)},
      {"samples_stored", static_cast<double>(points.size())},
      {"samples_lost", static_cast<double>(run.samples_lost)},
      {"gaps", gaps.count},
      {"longest_gap_s", gaps.longest_s},
      {"resent_share", share(points, has_flag(rheonaut_TELEMETRY_FLAG_BACKFILL))},
      {"link_lost_share", share(points, has_flag(rheonaut_TELEMETRY_FLAG_LINK_LOSS))},
      {"sensor_fault_share", share(points, has_flag(rheonaut_TELEMETRY_FLAG_SENSOR_FAULT))},
      {"saturated_share", share(points, has_flag(rheonaut_TELEMETRY_FLAG_SATURATED))},
      {"latched_share", share(points, is_latched)},
      {"driven_share", share(points, is_driven)},
      {"longest_at_power_s", longest_s(points, period_s, at_power)},
      {"duty_rms", duty_rms(points)},
      {"position_range_m", positions ? std::optional{positions->second - positions->first} : std::nullopt},
      {"position_sd_max_m", sds ? std::optional{sds->second} : std::nullopt},
  };
}

}  // namespace server::analysis
