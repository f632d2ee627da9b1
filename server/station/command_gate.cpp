// Envelope and preconditions of commands.
#include "server/station/command_gate.hpp"

#include <fmt/format.h>
#include <cmath>

namespace server {
namespace {

Result<void> within(const char* name, double value, double minimum, double maximum) {
  if (std::isfinite(value) && value >= minimum && value <= maximum) return {};
  return fail(ErrorCode::invalid, fmt::format("{} = {} is outside {} to {}", name, value, minimum, maximum),
              "out_of_range");
}

Result<void> check_values(const protocol::Command& command, const CommandLimits& limits) {
  const auto setpoint = [&limits](double value) {
    return within("setpoint_m", value, limits.setpoint_min_m, limits.setpoint_max_m);
  };
  const auto duty = [&limits](double value) { return within("duty", value, limits.duty_min, limits.duty_max); };
  switch (command.which_action) {
    case rheonaut_Command_set_mode_tag: {
      const auto& mode = command.action.set_mode;
      if (mode.mode == rheonaut_MODE_AUTO && !mode.has_setpoint_m) {
        return fail(ErrorCode::invalid, "mode auto needs setpoint_m", "malformed");
      }
      if (mode.mode == rheonaut_MODE_MANUAL && mode.has_setpoint_m) {
        return fail(ErrorCode::invalid, "mode manual takes no setpoint_m", "malformed");
      }
      if (mode.mode == rheonaut_MODE_AUTO) return setpoint(mode.setpoint_m);
      if (mode.mode == rheonaut_MODE_MANUAL) return {};
      return fail(ErrorCode::invalid, "mode must be manual or auto; emergency is entered by an emergency stop",
                  "malformed");
    }
    case rheonaut_Command_set_setpoint_tag: return setpoint(command.action.set_setpoint.setpoint_m);
    case rheonaut_Command_set_duty_tag: {
      const auto lease = within("lease_ms", command.action.set_duty.lease_ms, 0, protocol::kLeaseMs);
      return lease ? duty(command.action.set_duty.duty) : lease;
    }
    case rheonaut_Command_renew_lease_tag:
      return within("lease_ms", command.action.renew_lease.lease_ms, 0, protocol::kLeaseMs);
    case rheonaut_Command_set_duty_schedule_tag: {
      const auto& schedule = command.action.set_duty_schedule;
      for (pb_size_t i = 0; i < schedule.duty_count; ++i) {
        if (auto checked = duty(schedule.duty[i]); !checked) return checked;
      }
      return {};
    }
    case rheonaut_Command_inject_disturbance_tag:
      return within("disturbance_m", command.action.inject_disturbance.disturbance_m, -limits.disturbance_max_m,
                    limits.disturbance_max_m);
    default: return {};
  }
}

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

}  // namespace

bool needs_control(const protocol::Command& command) {
  return command.which_action != rheonaut_Command_ping_tag &&
         command.which_action != rheonaut_Command_get_parameters_tag;
}

Result<void> check_command(const protocol::Command& command, const RobotState& robot, const CommandLimits& limits) {
  if (auto values = check_values(command, limits); !values) return values;
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

}  // namespace server
