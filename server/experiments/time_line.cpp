#include "server/experiments/time_line.hpp"

#include <algorithm>
#include <cmath>

#include "control/tuning/three_tones.hpp"
#include "server/experiments/duty_signals.hpp"

namespace server::experiments {
namespace {

std::uint64_t scan_ticks(double distance_m, double velocity_m_s) {
  return static_cast<std::uint64_t>(std::ceil(std::abs(distance_m) / velocity_m_s / kTick_s - 1e-6));
}

// Where the mode changes nothing else is commanded for kModeChangeTicks: a robot drops what waits for its time then.
struct ModeChange {
  std::uint64_t before = 0;    // ticks before the step's own commands
  std::uint64_t at_least = 0;  // ticks of a setpoint
};

ModeChange mode_change_at(const Step& step, bool& is_auto) {
  const bool is_change = is_closed_loop(step.kind) != is_auto;
  is_auto = is_closed_loop(step.kind);
  if (!is_change) return {};
  return step.kind == StepKind::setpoint ? ModeChange{0, kModeChangeTicks} : ModeChange{kModeChangeTicks, 0};
}

// Moves the setpoint in equal parts, the last one to its end; returns the ticks of the way.
std::uint64_t add_scan(const Step& step, double from_m, double to_m, std::size_t index, TimeLine& line) {
  const std::uint64_t way = scan_ticks(to_m - from_m, step.velocity_m_s);
  const auto hold = static_cast<std::uint64_t>(std::llround(step.every_s / kTick_s));
  for (std::uint64_t tick = 0; tick < way; tick += hold) {
    const double share = std::min(1.0, static_cast<double>(tick + hold) / static_cast<double>(way));
    line.actions.push_back({line.ticks + tick, ActionKind::setpoint, std::lerp(from_m, to_m, share), index});
  }
  return way;
}

// The three sines begin apart, so that they seldom add up to their largest sum. The step ends at their mean.
void add_tones(const Step& step, double factor, std::size_t index, TimeLine& line) {
  const auto tones_rad_s = control::three_tones_rad_s(step.crossover_rad_s);
  const auto hold = static_cast<std::uint64_t>(std::llround(step.every_s / kTick_s));
  for (std::uint64_t tick = 0; tick < ticks_of(step); tick += hold) {
    double sum = 0;
    for (std::size_t i = 0; i < tones_rad_s.size(); ++i) {
      sum += std::sin(tones_rad_s[i] * static_cast<double>(tick) * kTick_s + 2 * static_cast<double>(i));
    }
    if (tick + hold >= ticks_of(step)) sum = 0;
    const double setpoint_m = factor * (step.setpoint_m + step.amplitude_m * sum);
    line.actions.push_back({line.ticks + tick, ActionKind::setpoint, setpoint_m, index});
  }
}

}  // namespace

TimeLine time_line_of(const Profile& all, const Variant& variant) {
  const Profile profile = profile_of_run(all, variant);
  TimeLine line;
  line.first_step = std::max<std::size_t>(variant.step, 1);
  double setpoint_m = 0;
  bool is_auto = false;
  for (std::size_t index = 0; index < profile.steps.size(); ++index) {
    const Step& step = profile.steps[index];
    line.step_begins.push_back(line.ticks);
    const ModeChange change_of_mode = mode_change_at(step, is_auto);
    if (change_of_mode.before > 0) {
      const ActionKind kind = is_auto ? ActionKind::setpoint : ActionKind::duty;
      line.actions.push_back({line.ticks, kind, is_auto ? setpoint_m : 0, index});
      line.ticks += change_of_mode.before;
    }
    for (const DutyChange& change : duty_changes(step)) {
      line.actions.push_back({line.ticks + change.tick, ActionKind::duty, change.duty * variant.duty_factor, index});
    }
    const double target_m = step.setpoint_m * variant.setpoint_factor;
    if (step.kind == StepKind::setpoint) line.actions.push_back({line.ticks, ActionKind::setpoint, target_m, index});
    if (step.kind == StepKind::disturbance) {
      const double disturbance_m = step.disturbance_m * variant.setpoint_factor;
      line.actions.push_back({line.ticks, ActionKind::disturbance, disturbance_m, index});
    }
    if (step.kind == StepKind::scan) line.ticks += add_scan(step, setpoint_m, target_m, index, line);
    if (step.kind == StepKind::tones) add_tones(step, variant.setpoint_factor, index, line);
    if (has_setpoint(step.kind)) setpoint_m = target_m;
    line.ticks += std::max(ticks_of(step), change_of_mode.at_least);
  }
  // SAFETY: a profile never ends with a running motor in manual.
  if (!profile.steps.empty() && !is_closed_loop(profile.steps.back().kind)) {
    line.actions.push_back({line.ticks, ActionKind::duty, 0, profile.steps.size() - 1});
  }
  return line;
}

double longest_duration_s(const Profile& profile) {
  double largest_factor = profile.sweep.setpoint_factor.empty() ? 1 : 0;
  for (const double factor : profile.sweep.setpoint_factor) largest_factor = std::max(largest_factor, std::abs(factor));
  std::uint64_t ticks = 0;
  double setpoint_m = 0;
  bool is_auto = false;
  if (profile.until) {
    for (const Step& step : profile.steps) ticks = std::max(ticks, ticks_of(step));
    return static_cast<double>(ticks) * kTick_s;
  }
  for (const Step& step : profile.steps) {
    const ModeChange change = mode_change_at(step, is_auto);
    if (step.kind == StepKind::scan) {
      ticks += scan_ticks((step.setpoint_m - setpoint_m) * largest_factor, step.velocity_m_s);
    }
    if (has_setpoint(step.kind)) setpoint_m = step.setpoint_m;
    ticks += change.before + std::max(ticks_of(step), change.at_least);
  }
  return static_cast<double>(ticks) * kTick_s;
}

}  // namespace server::experiments
