// From sample to sample, and from outside position to outside position, filling the rows between.
#include "server/analysis/comparison/grid_trace.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/analysis/comparison/outside_at.hpp"
#include "server/storage/samples/position_sd.hpp"

namespace server::analysis {
namespace {

constexpr double kSameTime_s = 5e-5;    // a row this near to a sample is at the sample
constexpr double kLongestStep_s = 0.1;  // between consecutive samples: a robot that made none measured nothing
constexpr float kMissing = std::numeric_limits<float>::quiet_NaN();

// The rows of the grid, of which some lie between two times.
struct Rows {
  double step_s = 0;
  std::int64_t first = 0, end = 0;

  std::size_t size() const { return static_cast<std::size_t>(end - first); }
  double time_s(std::size_t row) const { return static_cast<double>(first + static_cast<std::int64_t>(row)) * step_s; }
  // Calls fill(row, share) for each row from here on to before there.
  template <class Fill>
  void between(double here_s, double there_s, const Fill& fill) const {
    auto row = static_cast<std::int64_t>(std::ceil((here_s - kSameTime_s) / step_s));
    const bool is_joined = there_s > here_s;
    const double last_s = (is_joined ? there_s : here_s + 2 * kSameTime_s) - kSameTime_s;
    for (row = std::max(row, first); row < end && static_cast<double>(row) * step_s < last_s; ++row) {
      const double since_s = static_cast<double>(row) * step_s - here_s;
      fill(static_cast<std::size_t>(row - first), is_joined ? std::clamp(since_s / (there_s - here_s), 0.0, 1.0) : 0.0);
    }
  }
};

Result<Rows> rows_of(const std::string& run, std::span<const double> times_s, double aligned_at_s,
                     const TraceGrid& grid) {
  if (times_s.empty()) return Rows{grid.step_s, 0, 0};
  const auto [earliest, latest] = std::ranges::minmax_element(times_s);
  const double from_s = std::max(*earliest - aligned_at_s, grid.from_s);
  const double to_s = std::min(*latest - aligned_at_s, grid.to_s);
  if (!(from_s <= to_s)) return Rows{grid.step_s, 0, 0};
  const double rows = (to_s - from_s) / grid.step_s;
  if (rows > static_cast<double>(kMaxGridRows)) {
    return fail(ErrorCode::invalid,
                fmt::format("{} has {:.0f} rows of {} s, at most {} are compared; choose a part or a coarser grid", run,
                            rows, grid.step_s, kMaxGridRows),
                "too_many_rows");
  }
  const auto first = static_cast<std::int64_t>(std::ceil((from_s - kSameTime_s) / grid.step_s));
  const auto last = static_cast<std::int64_t>(std::floor((to_s + kSameTime_s) / grid.step_s));
  return Rows{grid.step_s, first, std::max(first, last + 1)};
}

// The value of a channel this far from one sample to the next.
float value_between(float here, float there, double share, bool holds) {
  if (share == 0 || holds) return here;
  return static_cast<float>(std::lerp(static_cast<double>(here), static_cast<double>(there), share));
}

// Calls fill(row, here, there, share) for each row that the samples say something about.
template <class Fill>
void for_each_row(std::span<const TracePoint> points, std::span<const double> times_s, double aligned_at_s,
                  const Rows& rows, const Fill& fill) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool joins = i + 1 < points.size() && follows(points[i], points[i + 1]) && times_s[i + 1] > times_s[i] &&
                       times_s[i + 1] - times_s[i] <= kLongestStep_s;
    const std::size_t next = joins ? i + 1 : i;
    rows.between(times_s[i] - aligned_at_s, times_s[next] - aligned_at_s,
                 [&](std::size_t row, double share) { fill(row, points[i], points[next], share); });
  }
}

// What was measured from outside takes the place of the robot's own, with the disturbance of each row.
void take_outside(const storage::StoredReference& reference, std::span<const TracePoint> points,
                  std::span<const double> times_s, double aligned_at_s, const Rows& rows,
                  const std::vector<float>& disturbance_m, std::vector<float>& position_m, std::vector<float>& sd_m) {
  std::ranges::fill(position_m, kMissing);
  std::ranges::fill(sd_m, kMissing);
  const auto first = std::ranges::find(points, reference.reference.span, &TracePoint::span);
  if (first == points.end()) return;
  const double begins_s = times_s[static_cast<std::size_t>(first - points.begin())] - aligned_at_s;
  for (std::size_t row = 0; row < rows.size(); ++row) {
    const double since_s = rows.time_s(row) - begins_s;
    if (since_s < 0) continue;
    const auto at_us = first->robot_time_us + static_cast<std::uint64_t>(std::llround(since_s * 1e6));
    const auto outside = outside_at(reference, at_us);
    if (!outside) continue;
    position_m[row] = static_cast<float>(outside->position_m) + disturbance_m[row];
    sd_m[row] = static_cast<float>(outside->sd_m);
  }
}

PositionSource source_of(std::span<const TracePoint> points) {
  const auto is_of_estimate = [](const TracePoint& point) {
    return storage::is_estimate(static_cast<double>(point.position_sd_m));
  };
  return std::ranges::any_of(points, is_of_estimate) ? PositionSource::estimate : PositionSource::known;
}

std::optional<std::size_t> position_column(const TraceChannels& channels) {
  const auto at = std::ranges::find(channels, &TracePoint::position_m, &TraceChannel::member);
  if (at == channels.end()) return std::nullopt;
  return static_cast<std::size_t>(at - channels.begin());
}

}  // namespace

const char* text(PositionSource value) {
  switch (value) {
    case PositionSource::outside: return "outside";
    case PositionSource::estimate: return "estimate";
    case PositionSource::known: return "known";
  }
  return "";
}

Result<GridTrace> trace_on_grid(const std::string& run, std::span<const TracePoint> points,
                                std::span<const double> times_s, double aligned_at_s, const TraceChannels& channels,
                                const TraceGrid& grid, const storage::StoredReference* reference) {
  const auto rows = rows_of(run, times_s, aligned_at_s, grid);
  if (!rows) return std::unexpected{rows.error()};
  GridTrace trace;
  trace.first_row = rows->first;
  trace.values.assign(channels.size(), std::vector<float>(rows->size(), kMissing));
  trace.position_sd_m.assign(rows->size(), kMissing);
  trace.position_source = source_of(points);
  std::vector<float> disturbance_m(rows->size(), kMissing);
  for_each_row(points, times_s, aligned_at_s, *rows,
               [&](std::size_t row, const TracePoint& here, const TracePoint& there, double share) {
                 for (std::size_t c = 0; c < channels.size(); ++c) {
                   const auto [name, member, holds] = *channels[c];
                   trace.values[c][row] = value_between(here.*member, there.*member, share, holds);
                 }
                 trace.position_sd_m[row] = value_between(here.position_sd_m, there.position_sd_m, share, false);
                 disturbance_m[row] = here.disturbance_m;
               });
  const auto position = position_column(channels);
  if (reference == nullptr || !position) return trace;
  trace.position_source = PositionSource::outside;
  trace.own_position_m = trace.values[*position];
  take_outside(*reference, points, times_s, aligned_at_s, *rows, disturbance_m, trace.values[*position],
               trace.position_sd_m);
  return trace;
}

}  // namespace server::analysis
