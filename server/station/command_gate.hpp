// The checks that every command passes before it is sent: envelope and preconditions. Pure.
#pragma once

#include <map>
#include <string>

#include "server/result.hpp"
#include "server/station/station_state.hpp"

namespace server {

// What the station allows to be commanded.
struct CommandLimits {
  double setpoint_min_m = -1.0;
  double setpoint_max_m = 1.0;
  double setpoint_step_m = 2.0;  // from the setpoint in force, or where there is none from where the robot is
  double duty_min = -1.0;
  double duty_max = 1.0;
  double power_duty = 0.9;         // above this |duty| the motor is at power
  double power_s = 60;             // for so long at most; the time counts down again as fast as it went up
  double disturbance_max_m = 0.5;  // magnitude
  bool operator==(const CommandLimits&) const = default;
};

// The limits that hold anywhere, and those of fluids that have their own: for as long as a run of the robot is open
// that names the fluid.
struct Envelope {
  CommandLimits anywhere;
  std::map<std::string, CommandLimits> of_fluid;

  const CommandLimits& in(const std::string& fluid) const {
    const auto own = of_fluid.find(fluid);
    return own == of_fluid.end() ? anywhere : own->second;
  }
};

bool moves_the_motor(const protocol::Command& command);

// False for what commands nothing: whoever may command at all may send it.
bool needs_control(const protocol::Command& command);

// invalid for a value outside the limits, conflict when the robot's state forbids the command now. Judges nothing that
// only the robot can know; the robot checks everything again.
Result<void> check_command(const protocol::Command& command, const RobotState& robot, const Envelope& envelope);

}  // namespace server
