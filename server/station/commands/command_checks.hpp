// The checks that every command passes before it is sent: envelope and preconditions. Pure.
#pragma once

#include "server/config/envelope.hpp"
#include "server/runtime/result.hpp"
#include "server/station/commands/orders_ahead.hpp"
#include "server/station/state/station_state.hpp"

namespace server::station {

bool moves_the_motor(const protocol::Command& command);

// False for commands that change nothing: any caller with the scope command may send them.
bool needs_control(const protocol::Command& command);

// invalid for a value outside the limits, conflict when the robot's state forbids the command now. `ahead`: what is on
// its way to the robot, or waits there. Judges nothing that only the robot can know; the robot checks everything again.
Result<void> check_command(const protocol::Command& command, const RobotState& robot, const config::Envelope& envelope,
                           const OrdersAhead& ahead);

// Whether what the robot does now, as telemetry shows it, and its schedules that run keep within these limits.
Result<void> check_motion(const RobotState& robot, const config::CommandLimits& limits, const OrdersAhead& ahead);

}  // namespace server::station
