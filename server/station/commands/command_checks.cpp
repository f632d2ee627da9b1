// Envelope and preconditions of commands.
#include "server/station/commands/command_checks.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

namespace server::station {
namespace {

Result<void> within(const char* name, double value, double minimum, double maximum) {
  if (std::isfinite(value) && value >= minimum && value <= maximum) return {};
  return fail(ErrorCode::invalid, fmt::format("{} = {} is outside {} to {}", name, value, minimum, maximum),
              "out_of_range");
}

// SAFETY: the motor runs at power no longer than the limit, also when each command alone is within it. What waits for
// its time or still runs counts too, ahead_s.
Result<void> check_power(double duty, double lasts_s, double ahead_s, const RobotState& robot,
                         const config::CommandLimits& limits) {
  const bool is_at_power = std::abs(duty) > limits.power_duty;
  if (!is_at_power || robot.at_power_s + ahead_s + lasts_s <= limits.power_s) return {};
  const std::string waits =
      ahead_s == 0 ? "" : fmt::format(", and what runs or waits for its time asks for {:.1f} s more", ahead_s);
  return fail(ErrorCode::conflict,
              fmt::format("duty = {} is above {}, where robot '{}' has run for {:.1f} s{}; the limit is {} s, and the "
                          "time goes down again below that duty",
                          duty, limits.power_duty, robot.id, robot.at_power_s, waits, limits.power_s),
              "too_long_at_power");
}

// The schedule's own time at power counts, too. Its last duty ends it.
Result<void> check_schedule(const protocol::Command& command, double ahead_s, const RobotState& robot,
                            const config::CommandLimits& limits) {
  const auto& schedule = command.action.set_duty_schedule;
  double highest = 0;
  for (pb_size_t i = 0; i < schedule.duty_count; ++i) {
    const double duty = schedule.duty[i];
    if (auto checked = within("duty", duty, limits.duty_min, limits.duty_max); !checked) return checked;
    if (i + 1 < schedule.duty_count) highest = std::max(highest, std::abs(duty));
  }
  return check_power(highest, at_power_s(command, robot.sample_period_us, limits), ahead_s, robot, limits);
}

// SAFETY: what runs or waits is extended only while it fits in the time at power. What has begun may be counted twice
// for a tick or two.
Result<void> check_renewal(double ahead_s, const RobotState& robot, const config::CommandLimits& limits) {
  const double twice_s = 2e-6 * robot.sample_period_us;
  if (ahead_s <= twice_s || robot.at_power_s + ahead_s <= limits.power_s + twice_s) return {};
  return fail(
      ErrorCode::conflict,
      fmt::format("robot '{}' has run for {:.1f} s above a duty of {}, and what runs or waits for its time asks "
                  "for {:.1f} s more; the limit is {} s",
                  robot.id, robot.at_power_s, limits.power_duty, ahead_s, limits.power_s),
      "too_long_at_power");
}

// SAFETY: a duty that runs since the limits were wider is not kept running. Duties are floats on the way.
Result<void> check_running_duty(const RobotState& robot, const config::CommandLimits& limits) {
  if (robot.context.mode != rheonaut_MODE_MANUAL) return {};
  return within("the running duty", robot.sample->duty, limits.duty_min - 1e-6, limits.duty_max + 1e-6);
}

// SAFETY: nor is a schedule that was accepted under wider ones, as far as it is still to run.
Result<void> check_running_schedules(const OrdersAhead& ahead, const RobotState& robot,
                                     const config::CommandLimits& limits) {
  for (const OrderAhead& order : ahead) {
    if (order.command->which_action != rheonaut_Command_set_duty_schedule_tag) continue;
    const auto& schedule = order.command->action.set_duty_schedule;
    for (pb_size_t i = 0; i < schedule.duty_count; ++i) {
      const bool is_last = i + 1 >= std::min(schedule.duty_count, schedule.tick_count);
      const bool is_over = !is_last && std::uint64_t{schedule.tick[i + 1]} * robot.sample_period_us <= order.sampled_us;
      if (is_over) continue;
      auto checked = within("a duty of the schedule that runs", schedule.duty[i], limits.duty_min, limits.duty_max);
      if (!checked) return checked;
    }
  }
  return {};
}

Result<void> check_values(const protocol::Command& command, const OrdersAhead& ahead, const RobotState& robot,
                          const config::CommandLimits& limits) {
  const double ahead_s = at_power_ahead_s(ahead, robot.sample_period_us, limits);
  const auto in_range = [&limits](double setpoint_m) {
    return within("setpoint_m", setpoint_m, limits.setpoint_min_m, limits.setpoint_max_m);
  };
  switch (command.which_action) {
    case rheonaut_Command_set_mode_tag: {
      const auto& mode = command.action.set_mode;
      if (mode.mode == rheonaut_MODE_AUTO && !mode.has_setpoint_m) {
        return fail(ErrorCode::invalid, "mode auto needs setpoint_m", "malformed");
      }
      if (mode.mode == rheonaut_MODE_MANUAL && mode.has_setpoint_m) {
        return fail(ErrorCode::invalid, "mode manual takes no setpoint_m", "malformed");
      }
      if (mode.mode == rheonaut_MODE_AUTO) return in_range(mode.setpoint_m);
      if (mode.mode == rheonaut_MODE_MANUAL) return {};
      return fail(ErrorCode::invalid, "mode must be manual or auto; emergency is entered by an emergency stop",
                  "malformed");
    }
    case rheonaut_Command_set_setpoint_tag: return in_range(command.action.set_setpoint.setpoint_m);
    case rheonaut_Command_set_duty_tag: {
      const double duty = command.action.set_duty.duty;
      auto checked = within("lease_ms", command.action.set_duty.lease_ms, 0, protocol::kLeaseMs);
      if (checked) checked = within("duty", duty, limits.duty_min, limits.duty_max);
      return checked ? check_power(duty, 0, ahead_s, robot, limits) : checked;
    }
    case rheonaut_Command_renew_lease_tag: {
      auto checked = within("lease_ms", command.action.renew_lease.lease_ms, 0, protocol::kLeaseMs);
      if (checked && robot.sample) checked = check_running_duty(robot, limits);
      if (checked) checked = check_running_schedules(ahead, robot, limits);
      if (checked && robot.sample) checked = check_power(robot.sample->duty, 0, 0, robot, limits);
      return checked ? check_renewal(ahead_s, robot, limits) : checked;
    }
    case rheonaut_Command_set_duty_schedule_tag: return check_schedule(command, ahead_s, robot, limits);
    case rheonaut_Command_set_controller_tag: {
      const auto& controller = command.action.set_controller;
      auto checked = within("duty_min", controller.duty_min, limits.duty_min, 0);
      return checked ? within("duty_max", controller.duty_max, 0, limits.duty_max) : checked;
    }
    case rheonaut_Command_inject_disturbance_tag:
      return within("disturbance_m", command.action.inject_disturbance.disturbance_m, -limits.disturbance_max_m,
                    limits.disturbance_max_m);
    default: return {};
  }
}

}  // namespace

bool moves_the_motor(const protocol::Command& command) {
  switch (command.which_action) {
    case rheonaut_Command_set_mode_tag: return command.action.set_mode.mode == rheonaut_MODE_AUTO;
    case rheonaut_Command_set_setpoint_tag:
    case rheonaut_Command_set_duty_tag:
    case rheonaut_Command_renew_lease_tag:
    case rheonaut_Command_set_duty_schedule_tag:
    case rheonaut_Command_inject_disturbance_tag: return true;
    default: return false;
  }
}

bool needs_control(const protocol::Command& command) {
  return command.which_action != rheonaut_Command_ping_tag &&
         command.which_action != rheonaut_Command_get_parameters_tag;
}

Result<void> check_command(const protocol::Command& command, const RobotState& robot, const config::Envelope& envelope,
                           const OrdersAhead& ahead) {
  const config::CommandLimits& limits = envelope.in(robot.fluid);
  auto values = check_values(command, ahead, robot, limits);
  if (values) values = check_steps(command, ahead, robot, limits);
  if (!values) {
    const std::string whose = envelope.is_listed(robot.fluid)
                                  ? fmt::format(" (limits of the fluid '{}')", robot.fluid)
                                  : " (the robot's fluid is not known, so the strictest limits of all fluids hold)";
    if (limits != envelope.anywhere()) values.error().detail += whose;
    return values;
  }
  // SAFETY: the station latches too: no motion command passes until the emergency was cleared.
  if (robot.latched() && moves_the_motor(command)) {
    return fail(ErrorCode::conflict, fmt::format("robot '{}' is in emergency; clear it first", robot.id), "latched");
  }
  // SAFETY: a clear must not overtake a stop that the robot has not acknowledged.
  if (robot.pending_stop && command.which_action == rheonaut_Command_clear_emergency_tag) {
    return fail(ErrorCode::conflict, "an emergency stop is still on its way to the robot; clear it when it has arrived",
                "stop_pending");
  }
  return {};
}

Result<void> check_motion(const RobotState& robot, const config::CommandLimits& limits, const OrdersAhead& ahead) {
  auto checked = check_running_schedules(ahead, robot, limits);
  if (!checked || !robot.sample) return checked;
  const bool has_setpoint = robot.context.mode == rheonaut_MODE_AUTO && robot.context.setpoint_m;
  if (!has_setpoint) return check_running_duty(robot, limits);
  return within("the setpoint in force", *robot.context.setpoint_m, limits.setpoint_min_m - 1e-6,
                limits.setpoint_max_m + 1e-6);
}

}  // namespace server::station
