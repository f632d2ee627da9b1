// Cuts a recording into steps.
#include "server/analysis/run_steps.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace server {
namespace {

constexpr double kBandOfStep = 0.02;

bool usable(const StepPoint& point) { return point.steered && std::isfinite(point.position_m); }

// Why a step begins with `point`, given the point before it.
std::optional<StepCause> step_at(const StepPoint& before, const StepPoint& point) {
  const bool continues = usable(before) && before.span == point.span && before.robot_time_us < point.robot_time_us;
  if (!continues || before.setpoint_m != point.setpoint_m) return StepCause::setpoint;
  if (before.disturbance_m != point.disturbance_m) return StepCause::disturbance;
  return std::nullopt;
}

class Cutter {
 public:
  void take(const StepPoint& point) {
    if (points_ == 0 || before_.span != point.span) span_began_us_ = point.robot_time_us;
    ++points_;
    if (!usable(point)) {
      finish();
    } else {
      const auto cause = step_at(before_, point);
      if (cause) begin(*cause, point);
      time_s_.push_back(seconds(point));
      position_m_.push_back(static_cast<double>(point.position_m));
      step_.last_seq = point.seq;
      step_.position_sd_m = std::max(step_.position_sd_m, static_cast<double>(point.position_sd_m));
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
    if (cause == StepCause::setpoint || band_m_ == 0) band_m_ = kBandOfStep * std::abs(step_.target_m - step_.start_m);
    step_.band_m = band_m_;
  }

  void finish() {
    if (!time_s_.empty() && step_.start_m != step_.target_m && step_.band_m > 0) {
      control::StepExperiment experiment;
      experiment.step_at_s = step_.at_s;
      experiment.start_m = step_.start_m;
      experiment.target_m = step_.target_m;
      experiment.band_m = step_.band_m;
      step_.metrics = control::measure_step(time_s_, position_m_, experiment);
      steps_.push_back(step_);
    }
    time_s_.clear();
    position_m_.clear();
  }

  StepPoint before_;
  std::uint64_t points_ = 0;
  std::uint64_t span_began_us_ = 0;
  double band_m_ = 0;
  MeasuredStep step_;
  std::vector<double> time_s_, position_m_;
  std::vector<MeasuredStep> steps_;
};

}  // namespace

const char* text(StepCause value) { return value == StepCause::setpoint ? "setpoint" : "disturbance"; }

std::vector<MeasuredStep> measure_steps(const std::vector<StepPoint>& points) {
  Cutter cutter;
  for (const StepPoint& point : points) cutter.take(point);
  return cutter.end();
}

}  // namespace server
