// Counts through the samples, or through the moments.
#include "server/analysis/comparison/alignment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/analysis/metrics/run_steps.hpp"

namespace server::analysis {
namespace {

constexpr float kLeastDutyStep = 0.01F;

bool is_steered(const TracePoint& point) { return std::isfinite(point.setpoint_m); }

// `before` is null at the beginning of a span.
bool is_step(const TracePoint* before, const TracePoint& point) {
  if (is_steered(point)) {
    const bool goes_on = before != nullptr && is_steered(*before) && before->setpoint_m == point.setpoint_m;
    return !goes_on && std::abs(point.setpoint_m - point.position_m) >= kSmallestStep_m;
  }
  if (!point.is_manual || before == nullptr || !before->is_manual) return false;
  return std::abs(point.duty - before->duty) >= kLeastDutyStep;
}

bool is_disturbance(const TracePoint* before, const TracePoint& point) {
  return before != nullptr && std::isfinite(point.disturbance_m) && std::isfinite(before->disturbance_m) &&
         before->disturbance_m != point.disturbance_m;
}

AlignedAt aligned_at_sample(std::span<const TracePoint> points, std::span<const double> times_s, std::size_t i) {
  const bool has_before = i > 0 && points[i - 1].span == points[i].span;
  return {times_s[i], has_before ? times_s[i] - times_s[i - 1] : 0, points[i].span, points[i].seq, points[i].utc_us};
}

// How many there are, in words.
std::string count_text(int count) { return count == 0 ? "none" : fmt::format("only {}", count); }

std::unexpected<Error> nothing_to_align(const std::string& run, const Alignment& alignment, int count) {
  return fail(ErrorCode::invalid, fmt::format("{} has no {}, {}", run, in_words(alignment), count_text(count)),
              "nothing_to_align");
}

template <class IsWanted>
Result<AlignedAt> at_sample(const std::string& run, std::span<const TracePoint> points, std::span<const double> times_s,
                            const Alignment& alignment, IsWanted is_wanted) {
  int count = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool has_before = i > 0 && points[i - 1].span == points[i].span;
    if (!is_wanted(has_before ? &points[i - 1] : nullptr, points[i])) continue;
    if (++count == alignment.number) return aligned_at_sample(points, times_s, i);
  }
  return nothing_to_align(run, alignment, count);
}

Result<AlignedAt> at_moment(const std::string& run, std::span<const TracePoint> points, std::span<const double> times_s,
                            const Alignment& alignment, std::span<const storage::RunMoment> moments) {
  int count = 0;
  for (const storage::RunMoment& moment : moments) {
    if (!alignment.name.empty() && moment.name != alignment.name) continue;
    if (++count < alignment.number) continue;
    const auto first = std::ranges::find(points, moment.span, &TracePoint::span);
    if (first == points.end()) break;  // nothing of its span is stored
    const auto since_us = static_cast<std::int64_t>(moment.robot_time_us - first->robot_time_us);
    const double at_s =
        times_s[static_cast<std::size_t>(first - points.begin())] + 1e-6 * static_cast<double>(since_us);
    return AlignedAt{at_s, 0, moment.span, moment.seq, first->utc_us + since_us};
  }
  return nothing_to_align(run, alignment, count);
}

}  // namespace

const char* text(AlignAt value) {
  switch (value) {
    case AlignAt::start: return "start";
    case AlignAt::step: return "step";
    case AlignAt::disturbance: return "disturbance";
    case AlignAt::event: return "event";
    case AlignAt::marker: return "marker";
  }
  return "";
}

std::string in_words(const Alignment& alignment) {
  if (alignment.at == AlignAt::start) return "start";
  if (alignment.at == AlignAt::event) return fmt::format("event {} {}", alignment.name, alignment.number);
  if (alignment.name.empty()) return fmt::format("{} {}", text(alignment.at), alignment.number);
  return fmt::format("{} '{}' {}", text(alignment.at), alignment.name, alignment.number);
}

Result<void> check_alignment(const Alignment& alignment) {
  if (alignment.at == AlignAt::event && !storage::is_event_kind(alignment.name)) {
    return fail(ErrorCode::invalid,
                fmt::format("event is '{}', which is no kind of event of a robot, such as detection", alignment.name),
                "out_of_range");
  }
  if (alignment.at == AlignAt::start && alignment.number != 1) {
    return fail(ErrorCode::invalid, fmt::format("number is {}, a run has one start", alignment.number), "out_of_range");
  }
  return {};
}

Result<AlignedAt> find_alignment(const std::string& run, std::span<const TracePoint> points,
                                 std::span<const double> times_s, const Alignment& alignment,
                                 std::span<const storage::RunMoment> moments) {
  if (points.empty()) return fail(ErrorCode::invalid, fmt::format("{} has no stored sample", run), "nothing_to_align");
  switch (alignment.at) {
    case AlignAt::start: return aligned_at_sample(points, times_s, 0);
    case AlignAt::step: return at_sample(run, points, times_s, alignment, is_step);
    case AlignAt::disturbance: return at_sample(run, points, times_s, alignment, is_disturbance);
    case AlignAt::event:
    case AlignAt::marker: break;
  }
  return at_moment(run, points, times_s, alignment, moments);
}

}  // namespace server::analysis
