// Commands as a station gives them, without ids and times: the sender adds those.
//
// Knows the protocol and no robot, so that a test of a robot with another layout in memory can use it.
#pragma once

#include "protocol/messages.hpp"

namespace sim_robot {

protocol::Command set_auto(float setpoint_m);
protocol::Command set_manual();
protocol::Command set_setpoint(float setpoint_m);
protocol::Command set_duty(float duty, std::uint32_t lease_ms = 0);
protocol::Command renew_lease();
protocol::Command emergency_stop();
protocol::Command clear_emergency(std::uint64_t emergency_id);
protocol::Command inject_disturbance(float disturbance_m);
protocol::Command zero_position();
protocol::Command ping();
protocol::Command drop_timed();
protocol::Command timed(protocol::Command command, std::uint64_t execute_at_robot_us);
protocol::Command set_controller(const protocol::Controller& controller);
protocol::Command restore_controller();
protocol::Command set_parameter(const char* name, float value);
protocol::Command get_parameters(std::uint32_t first_index);

}  // namespace sim_robot
