// The checks that every command passes before it is sent: envelope and preconditions. Pure.
#pragma once

#include "server/result.hpp"
#include "server/station/station_state.hpp"

namespace server {

// What the station allows to be commanded.
struct CommandLimits {
  double setpoint_min_m = -1.0;
  double setpoint_max_m = 1.0;
  double duty_min = -1.0;
  double duty_max = 1.0;
  double disturbance_max_m = 0.5;  // magnitude
};

// False for what commands nothing: whoever may command at all may send it.
bool needs_control(const protocol::Command& command);

// invalid for a value outside the limits, conflict when the robot's state forbids the command now. Judges nothing that
// only the robot can know; the robot checks everything again.
Result<void> check_command(const protocol::Command& command, const RobotState& robot, const CommandLimits& limits);

}  // namespace server
