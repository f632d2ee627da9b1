#include "server/experiments/limits_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace server::experiments {
namespace {

Result<void> within(const Action& action, const char* what, double minimum, double maximum) {
  if (action.value >= minimum && action.value <= maximum) return {};
  return fail(ErrorCode::invalid,
              fmt::format("step {}: {} = {} is outside {} to {}, the limits of the station", action.step + 1, what,
                          action.value, minimum, maximum),
              "out_of_range");
}

Result<void> check_action(const Action& action, const config::CommandLimits& limits, double& setpoint_m) {
  switch (action.kind) {
    case ActionKind::duty: return within(action, "duty", limits.duty_min, limits.duty_max);
    case ActionKind::disturbance:
      return within(action, "disturbance_m", -limits.disturbance_max_m, limits.disturbance_max_m);
    case ActionKind::setpoint: break;
  }
  if (auto allowed = within(action, "setpoint_m", limits.setpoint_min_m, limits.setpoint_max_m); !allowed)
    return allowed;
  const double step_m = std::abs(action.value - setpoint_m);
  setpoint_m = action.value;
  if (step_m <= limits.setpoint_step_m + 1e-6) return {};
  return fail(ErrorCode::invalid,
              fmt::format("step {}: setpoint_m = {} is {:.3f} m from the one before it; a step is at most {} m",
                          action.step + 1, action.value, step_m, limits.setpoint_step_m),
              "step_too_large");
}

}  // namespace

Result<void> check_limits(const Profile& profile, const config::Envelope& envelope, const std::string& fluid_of_robot) {
  for (const Variant& variant : variants_of(profile)) {
    if (variant.repeat > 1) continue;
    if (!variant.fluid.empty()) {
      if (auto listed = envelope.listed(variant.fluid); !listed) return std::unexpected{listed.error()};
    }
    const config::CommandLimits& limits = envelope.in(variant.fluid.empty() ? fluid_of_robot : variant.fluid);
    double setpoint_m = 0;
    const TimeLine line = time_line_of(profile, variant);
    for (Action action : line.actions) {
      if (variant.step > 0) action.step = variant.step - 1;
      if (auto allowed = check_action(action, limits, setpoint_m); !allowed) return allowed;
    }
  }
  return {};
}

Demands demands_of(const Profile& profile) {
  Demands demands;
  const bool goes_back = profile.conditions.start == StartPosition::back;
  const bool has_several_runs = profile.until || variants_of(profile).size() > 1;
  demands.longest_auto_s =
      std::max(profile.until ? 0 : longest_auto_s(profile), goes_back && has_several_runs ? kWayBack_s : 0);
  for (const Variant& variant : variants_of(profile)) {
    if (variant.repeat > 1) continue;
    const TimeLine line = time_line_of(profile, variant);
    for (const Action& action : line.actions) {
      const std::size_t step = variant.step > 0 ? variant.step : action.step + 1;
      if (action.kind == ActionKind::duty && action.value < demands.duty_min) {
        demands.duty_min = action.value;
        demands.duty_step = step;
      }
      if (action.kind == ActionKind::disturbance && std::abs(action.value) > demands.disturbance_max_m) {
        demands.disturbance_max_m = std::abs(action.value);
        demands.disturbance_step = step;
      }
      if (action.kind != ActionKind::setpoint) continue;
      if (action.value < demands.setpoint_min_m) {
        demands.setpoint_min_m = action.value;
        demands.setpoint_min_step = step;
      }
      if (action.value > demands.setpoint_max_m) {
        demands.setpoint_max_m = action.value;
        demands.setpoint_max_step = step;
      }
    }
  }
  return demands;
}

Result<void> check_demands(const Demands& demands, const RobotLimits& limits) {
  if (demands.longest_auto_s > limits.auto_limit_s) {
    return fail(ErrorCode::invalid,
                fmt::format("the profile stays in auto for {:.1f} s; the robot's auto_limit_s is {} s",
                            demands.longest_auto_s, limits.auto_limit_s),
                "auto_limit");
  }
  if (demands.duty_min < 0 && !limits.has_reverse) {
    return fail(
        ErrorCode::invalid,
        fmt::format("step {}: duty = {:.3g}, and the robot's controller has duty_min = 0, as for a motor without "
                    "reverse, which refuses it: take a profile whose duties are not below 0, such as "
                    "identification_one_way; if the motor has reverse, send a controller that uses it first",
                    demands.duty_step, demands.duty_min),
        "out_of_range");
  }
  if (static_cast<float>(demands.disturbance_max_m) > limits.disturbance_max_m) {
    return fail(ErrorCode::invalid,
                fmt::format("step {}: a disturbance of {:.6g} m is beyond the robot's setpoint_limit_m, {:.6g} m",
                            demands.disturbance_step, demands.disturbance_max_m, limits.disturbance_max_m),
                "out_of_range");
  }
  const bool is_too_low = static_cast<float>(demands.setpoint_min_m) < limits.setpoint_min_m;  // as the robot compares
  if (!is_too_low && static_cast<float>(demands.setpoint_max_m) <= limits.setpoint_max_m) return {};
  return fail(ErrorCode::invalid,
              fmt::format("step {}: setpoint_m = {:.6g} is outside {:.6g} to {:.6g} m, the limits of the robot "
                          "(setpoint_limit_m, position_limit_min_m, position_limit_max_m)",
                          is_too_low ? demands.setpoint_min_step : demands.setpoint_max_step,
                          is_too_low ? demands.setpoint_min_m : demands.setpoint_max_m, limits.setpoint_min_m,
                          limits.setpoint_max_m),
              "out_of_range");
}

double longest_auto_s(const Profile& profile) {
  std::uint64_t longest = 0;
  for (const Variant& variant : variants_of(profile)) {
    if (variant.repeat > 1) continue;
    const TimeLine line = time_line_of(profile, variant);
    std::uint64_t since = line.ticks;
    bool is_auto = false;
    for (const Action& action : line.actions) {
      const bool to_auto = action.kind != ActionKind::duty;
      if (to_auto && !is_auto) since = action.tick;
      if (!to_auto && is_auto) longest = std::max(longest, action.tick - since);
      is_auto = to_auto;
    }
    if (is_auto) longest = std::max(longest, line.ticks - since);
  }
  return static_cast<double>(longest) * kTick_s;
}

}  // namespace server::experiments
