#include "server/experiments/preview.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "control/models/modal_plant.hpp"

namespace server::experiments {
namespace {

constexpr double kPowerDuty = 0.9;
constexpr double kDiverged_m = 1e3;

struct Commanded {
  bool is_auto = false;
  double duty = 0, setpoint_m = 0, disturbance_m = 0;
};

void apply(const Action& action, Commanded& commanded, control::SectionFilter& controller) {
  switch (action.kind) {
    case ActionKind::duty:
      commanded.is_auto = false;
      commanded.duty = action.value;
      return;
    case ActionKind::setpoint:
      if (!commanded.is_auto) controller.reset();
      commanded.is_auto = true;
      commanded.setpoint_m = action.value;
      return;
    case ActionKind::disturbance: commanded.disturbance_m = action.value; return;
  }
}

std::string place(const Profile& profile, const TimeLine& line, std::size_t tick) {
  const auto after = std::ranges::upper_bound(line.step_begins, tick);
  const auto step = static_cast<std::size_t>(after - line.step_begins.begin()) - 1;
  return fmt::format("after {:.2f} s, in step {} ({})", static_cast<double>(tick) * kTick_s, line.first_step + step,
                     step_kinds()[static_cast<std::size_t>(profile.steps[step].kind)]);
}

// The first sample that is outside, of each bound.
void find_problems(const Profile& profile, const TimeLine& line, Preview& preview) {
  const auto report = [&](const char* what, double bound, const auto& is_outside) {
    const auto first = std::ranges::find_if(preview.position_m, is_outside);
    if (first == preview.position_m.end()) return;
    const auto tick = static_cast<std::size_t>(first - preview.position_m.begin());
    preview.problems.push_back(fmt::format("the predicted position passes {} ({} m) {}", what, bound,
                                           place(profile, line, std::min(tick, line.ticks - 1))));
  };
  const ProfileLimits& limits = profile.limits;
  const AbortCriteria& abort = profile.abort;
  report("limits.position_min_m", limits.position_min_m, [&](double at_m) { return at_m < limits.position_min_m; });
  report("limits.position_max_m", limits.position_max_m, [&](double at_m) { return !(at_m <= limits.position_max_m); });
  report("abort.position_min_m", abort.position_min_m, [&](double at_m) { return at_m < abort.position_min_m; });
  report("abort.position_max_m", abort.position_max_m, [&](double at_m) { return at_m > abort.position_max_m; });
  if (preview.at_power_s > abort.power_s) {
    preview.problems.push_back(fmt::format("the duty is beyond {} for {:.1f} s, abort.power_s is {} s", kPowerDuty,
                                           preview.at_power_s, abort.power_s));
  }
}

void measure(Preview& preview) {
  const auto [lowest, highest] = std::ranges::minmax(preview.position_m);
  preview.position_min_m = lowest;
  preview.position_max_m = highest;
  double at_power_s = 0;
  for (std::size_t k = 0; k < preview.duty.size(); ++k) {
    if (k > 0) preview.travel_m += std::abs(preview.position_m[k] - preview.position_m[k - 1]);
    at_power_s = std::abs(preview.duty[k]) > kPowerDuty ? at_power_s + kTick_s : 0;
    preview.at_power_s = std::max(preview.at_power_s, at_power_s);
  }
}

}  // namespace

Preview preview_of(const Profile& profile, const TimeLine& line, const control::FractionalModel& model,
                   const control::ParallelSections& sections, double duty_min, double duty_max, double from_m) {
  control::ModalPlant plant{model, kTick_s};
  control::SectionFilter controller{sections};
  Commanded commanded;
  Preview preview;
  auto next = line.actions.begin();
  for (std::uint64_t tick = 0; tick <= line.ticks; ++tick) {
    for (; next != line.actions.end() && next->tick <= tick; ++next) apply(*next, commanded, controller);
    const double position_m = from_m + plant.position_m();
    const double measured_m = position_m + commanded.disturbance_m;
    const double wanted = commanded.is_auto ? controller.step(commanded.setpoint_m - measured_m) : commanded.duty;
    const double duty = std::clamp(wanted, duty_min, duty_max);  // (1)
    preview.time_s.push_back(static_cast<double>(tick) * kTick_s);
    preview.position_m.push_back(position_m);
    preview.velocity_m_s.push_back(plant.velocity_m_s());
    preview.duty.push_back(duty);
    preview.setpoint_m.push_back(commanded.is_auto ? commanded.setpoint_m : std::numeric_limits<double>::quiet_NaN());
    if (!(std::abs(position_m) < kDiverged_m)) break;
    plant.step(duty);
  }
  measure(preview);
  find_problems(profile, line, preview);
  return preview;
}

}  // namespace server::experiments
