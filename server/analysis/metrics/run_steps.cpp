// Cuts a recording into steps.
#include "server/analysis/metrics/run_steps.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/storage/samples/position_sd.hpp"

namespace server::analysis {
namespace {

constexpr double kBandOfStep = 0.02;
constexpr double kShortestStepS = 1;     // until the next setpoint
constexpr double kLongestPauseS = 0.25;  // in a reference: a longer one hides too much of a step
constexpr double kLongestStepS = 0.1;    // between samples of the robot, to compare in between
constexpr std::size_t kFewestPositionsOfAStep = 10;

// Compares the robot's own position with the reference, in the order of time.
class Comparison {
 public:
  void add(double error_m, double own_sd_m, double outside_sd_m) {
    squares_ += error_m * error_m;
    result_.worst_m = std::max(result_.worst_m, std::abs(error_m));
    within_ += std::abs(error_m) <= 2 * std::hypot(own_sd_m, outside_sd_m) ? 1U : 0U;
    ++result_.samples;
  }
  std::optional<EstimateError> end() {
    if (result_.samples == 0) return std::nullopt;
    const auto count = static_cast<double>(result_.samples);
    result_.rms_m = std::sqrt(squares_ / count);
    result_.within_2_sd = static_cast<double>(within_) / count;
    return result_;
  }

 private:
  EstimateError result_;
  double squares_ = 0;
  std::size_t within_ = 0;
};

// What the robot believed at this time, between two samples: where it is, without the disturbance.
void compare(const StepPoint& before, const StepPoint& after, std::uint64_t at_us, double outside_m,
             double outside_sd_m, Comparison& into) {
  const double step_s = static_cast<double>(after.robot_time_us - before.robot_time_us) * 1e-6;
  const double share = step_s > 0 ? static_cast<double>(at_us - before.robot_time_us) * 1e-6 / step_s : 0;
  const double first_m = static_cast<double>(before.position_m - before.disturbance_m);
  const double second_m = static_cast<double>(after.position_m - after.disturbance_m);
  const double own_m = std::lerp(first_m, second_m, share), own_sd_m = static_cast<double>(after.position_sd_m);
  if (step_s > kLongestStepS || !std::isfinite(own_m) || !std::isfinite(own_sd_m)) return;
  into.add(own_m - outside_m, own_sd_m, outside_sd_m);
}

bool usable(const StepPoint& point) { return point.steered && std::isfinite(point.position_m); }

struct PositionAt {
  double position_m = 0, sd_m = 0;
};

// Where a line through the positions from `first` to before `last`, weighed by their sds, passes at this time. Its sd
// grows by what the positions scatter more about the line than they are said to.
PositionAt on_line(const storage::OutsidePositions& outside, std::size_t first, std::size_t last, std::uint64_t at_us) {
  const auto after_s = [&](std::size_t i) {
    return (static_cast<double>(outside.robot_time_us[i]) - static_cast<double>(at_us)) * 1e-6;
  };
  const auto weight = [&](std::size_t i) { return 1 / (outside.position_sd_m[i] * outside.position_sd_m[i]); };
  double weights = 0, mean_s = 0, mean_m = 0;
  for (std::size_t i = first; i < last; ++i) {
    weights += weight(i);
    mean_s += weight(i) * after_s(i);
    mean_m += weight(i) * outside.position_m[i];
  }
  mean_s /= weights, mean_m /= weights;
  double spread_s2 = 0, slope_m_s = 0;
  for (std::size_t i = first; i < last; ++i) {
    spread_s2 += weight(i) * (after_s(i) - mean_s) * (after_s(i) - mean_s);
    slope_m_s += weight(i) * (after_s(i) - mean_s) * (outside.position_m[i] - mean_m);
  }
  if (last - first < 2) return {mean_m, std::sqrt(1 / weights)};
  slope_m_s /= spread_s2;
  double chi_square = 0;
  for (std::size_t i = first; i < last; ++i) {
    const double residual_m = outside.position_m[i] - mean_m - slope_m_s * (after_s(i) - mean_s);
    chi_square += weight(i) * residual_m * residual_m;
  }
  const double freedom = std::max(1.0, static_cast<double>(last - first) - 2);
  const double variance_m2 = (1 / weights + mean_s * mean_s / spread_s2) * std::max(1.0, chi_square / freedom);
  return {mean_m - slope_m_s * mean_s, std::sqrt(variance_m2)};
}

bool continues(const StepPoint& before, const StepPoint& point) {
  return usable(before) && before.span == point.span && before.robot_time_us < point.robot_time_us;
}

// Why a step begins with `point`, given the point before it.
std::optional<StepCause> step_at(const StepPoint& before, const StepPoint& point) {
  if (!continues(before, point) || before.setpoint_m != point.setpoint_m) return StepCause::setpoint;
  if (before.disturbance_m != point.disturbance_m) return StepCause::disturbance;
  return std::nullopt;
}

class Cutter {
 public:
  explicit Cutter(const storage::StoredReference* reference) : reference_{reference} {}

  void take(const StepPoint& point) {
    if (points_ == 0 || before_.span != point.span) span_began_us_ = point.robot_time_us;
    ++points_;
    if (!usable(point)) {
      finish();
    } else {
      const auto cause = step_at(before_, point);
      const bool is_on_a_path = cause == StepCause::setpoint && continues(before_, point) && !time_s_.empty() &&
                                seconds(point) - step_.at_s < kShortestStepS;
      if (is_on_a_path) drop();
      if (cause) begin(*cause, point);
      points_of_step_.push_back(point);
      time_s_.push_back(seconds(point));
      position_m_.push_back(static_cast<double>(point.position_m));
      step_.last_seq = point.seq;
      step_.position_sd_m = storage::larger_sd_m(step_.position_sd_m, static_cast<double>(point.position_sd_m));
    }
    before_ = point;
  }

  std::vector<MeasuredStep> end() {
    finish();
    return std::move(steps_);
  }

 private:
  double seconds(const StepPoint& point) const {
    return static_cast<double>(point.robot_time_us - span_began_us_) * 1e-6;
  }

  void begin(StepCause cause, const StepPoint& point) {
    finish();
    step_ = {};
    step_.cause = cause;
    step_.span = point.span;
    step_.first_seq = point.seq;
    step_.at_s = seconds(point);
    step_.start_m = static_cast<double>(point.position_m);
    step_.target_m = static_cast<double>(point.setpoint_m);
    step_.band_m = cause == StepCause::setpoint || band_m_ == 0 ? kBandOfStep * size_m() : band_m_;
  }

  double size_m() const { return std::abs(step_.target_m - step_.start_m); }

  void finish() {
    if (!time_s_.empty() && size_m() >= kSmallestStep_m) {
      band_m_ = step_.band_m;
      control::StepExperiment experiment;
      experiment.step_at_s = step_.at_s;
      experiment.start_m = step_.start_m;
      experiment.target_m = step_.target_m;
      experiment.band_m = step_.band_m;
      step_.metrics = control::measure_step(time_s_, position_m_, experiment);
      if (reference_ != nullptr && reference_->reference.span == step_.span) measure_from_outside();
      steps_.push_back(step_);
    }
    drop();
  }

  void drop() {
    time_s_.clear();
    position_m_.clear();
    points_of_step_.clear();
  }

  // The reference in the step, if it covers it without a pause: what it measured takes the place of the estimate.
  void measure_from_outside() {
    const storage::OutsidePositions& outside = reference_->positions;
    const std::uint64_t begin_us = points_of_step_.front().robot_time_us;
    const std::uint64_t end_us = points_of_step_.back().robot_time_us;
    const auto first = std::ranges::lower_bound(outside.robot_time_us, begin_us) - outside.robot_time_us.begin();
    const auto last = std::ranges::upper_bound(outside.robot_time_us, end_us) - outside.robot_time_us.begin();
    const auto from = static_cast<std::size_t>(first), to = static_cast<std::size_t>(last);
    if (to < from + kFewestPositionsOfAStep) return;
    const auto pause_s = [](std::uint64_t a, std::uint64_t b) { return static_cast<double>(b - a) * 1e-6; };
    bool is_covered = pause_s(begin_us, outside.robot_time_us[from]) <= kLongestPauseS &&
                      pause_s(outside.robot_time_us[to - 1], end_us) <= kLongestPauseS;
    for (std::size_t i = from + 1; i < to && is_covered; ++i) {
      is_covered = pause_s(outside.robot_time_us[i - 1], outside.robot_time_us[i]) <= kLongestPauseS;
    }
    if (is_covered) take_reference(from, to);
  }

  void take_reference(std::size_t from, std::size_t to) {
    const storage::OutsidePositions& outside = reference_->positions;
    const double disturbance_m = static_cast<double>(points_of_step_.front().disturbance_m);
    std::vector<double> time_s, position_m;
    double squares_m2 = 0, sd_m = 0;
    Comparison comparison;
    std::size_t after = 1;
    for (std::size_t i = from; i < to; ++i) {
      const std::uint64_t at_us = outside.robot_time_us[i];
      time_s.push_back(static_cast<double>(at_us - span_began_us_) * 1e-6);
      position_m.push_back(outside.position_m[i] + disturbance_m);
      squares_m2 += outside.position_sd_m[i] * outside.position_sd_m[i];
      sd_m = std::max(sd_m, outside.position_sd_m[i]);
      while (after < points_of_step_.size() && points_of_step_[after].robot_time_us < at_us) ++after;
      if (after == points_of_step_.size()) continue;
      compare(points_of_step_[after - 1], points_of_step_[after], at_us, outside.position_m[i],
              outside.position_sd_m[i], comparison);
    }
    control::StepExperiment experiment;
    experiment.step_at_s = time_s.front();
    const PositionAt start = start_from_outside(from);
    experiment.start_m = start.position_m + disturbance_m;
    experiment.target_m = step_.target_m;
    experiment.band_m = step_.band_m;
    experiment.noise_sd_m = std::sqrt(squares_m2 / static_cast<double>(to - from));
    if (experiment.start_m == experiment.target_m) return;
    step_.metrics = control::measure_step(time_s, position_m, experiment);
    const double late_s = time_s.front() - step_.at_s;  // the first of them comes after the step
    if (step_.metrics.settling_s) *step_.metrics.settling_s += late_s;
    step_.metrics.peak_time_s += late_s;
    step_.start_m = experiment.start_m;
    step_.position_sd_m = std::hypot(std::max(sd_m, start.sd_m), reference_->reference.zero_sd_m.value_or(0));
    step_.is_from_outside = true;
    step_.estimate_error = comparison.end();
  }

  // Where the robot was when the step began, also in motion: on the line through the positions shortly before it, and
  // the first one after it where those are too few.
  PositionAt start_from_outside(std::size_t from) const {
    const storage::OutsidePositions& outside = reference_->positions;
    const std::uint64_t begin_us = points_of_step_.front().robot_time_us;
    constexpr std::uint64_t kShortlyUs = 200'000;
    constexpr std::size_t kFewestOfLine = 3;
    std::size_t first = from;
    while (first > 0 && outside.robot_time_us[first - 1] + kShortlyUs >= begin_us) --first;
    return on_line(outside, first, from - first < kFewestOfLine ? from + 1 : from, begin_us);
  }

  const storage::StoredReference* reference_;
  StepPoint before_;
  std::uint64_t points_ = 0;
  std::uint64_t span_began_us_ = 0;
  double band_m_ = 0;
  MeasuredStep step_;
  std::vector<double> time_s_, position_m_;
  std::vector<StepPoint> points_of_step_;
  std::vector<MeasuredStep> steps_;
};

}  // namespace

const char* text(StepCause value) { return value == StepCause::setpoint ? "setpoint" : "disturbance"; }

const char* position_source(const MeasuredStep& step) {
  if (step.is_from_outside) return "outside";
  return storage::is_estimate(step.position_sd_m) ? "estimate" : "known";
}

std::vector<MeasuredStep> measure_steps(const std::vector<StepPoint>& points,
                                        const storage::StoredReference* reference) {
  Cutter cutter{reference};
  for (const StepPoint& point : points) cutter.take(point);
  return cutter.end();
}

std::optional<EstimateError> estimate_error(const std::vector<StepPoint>& points,
                                            const storage::StoredReference& reference) {
  const storage::OutsidePositions& outside = reference.positions;
  Comparison comparison;
  std::size_t next = 0;
  for (std::size_t k = 1; k < points.size(); ++k) {
    const StepPoint &before = points[k - 1], &after = points[k];
    if (after.span != reference.reference.span || before.span != after.span) continue;
    while (next < outside.size() && outside.robot_time_us[next] < before.robot_time_us) ++next;
    for (; next < outside.size() && outside.robot_time_us[next] < after.robot_time_us; ++next) {
      compare(before, after, outside.robot_time_us[next], outside.position_m[next], outside.position_sd_m[next],
              comparison);
    }
  }
  return comparison.end();
}

StepPoint step_point(const storage::StoredSample& stored) {
  StepPoint point;
  point.span = stored.span;
  point.seq = stored.seq;
  point.robot_time_us = stored.robot_time_us;
  point.position_m = stored.sample.position_m;
  point.disturbance_m = station::or_nan(stored.disturbance_m);
  point.setpoint_m = stored.setpoint_m.value_or(0);
  point.steered = stored.mode == rheonaut_MODE_AUTO && stored.setpoint_m.has_value();
  point.position_sd_m = station::or_nan(stored.position_sd_m);
  return point;
}

RunMeasures measures_of(const std::vector<StepPoint>& points,
                        const std::optional<storage::StoredReference>& reference) {
  RunMeasures measures;
  measures.steps = measure_steps(points, reference ? &*reference : nullptr);
  if (reference) {
    measures.reference = reference->reference;
    measures.estimate_error = estimate_error(points, *reference);
  }
  return measures;
}

}  // namespace server::analysis
