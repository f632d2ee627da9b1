// Fills in the commands of the protocol.
#include "sim_robot/lab/station_commands.hpp"

#include <cstring>

namespace sim_robot {
namespace {

protocol::Command command_of(pb_size_t action) {
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = action;
  return command;
}

}  // namespace

protocol::Command set_auto(float setpoint_m) {
  protocol::Command command = command_of(rheonaut_Command_set_mode_tag);
  command.action.set_mode = {rheonaut_MODE_AUTO, true, setpoint_m};
  return command;
}

protocol::Command set_manual() {
  protocol::Command command = command_of(rheonaut_Command_set_mode_tag);
  command.action.set_mode.mode = rheonaut_MODE_MANUAL;
  return command;
}

protocol::Command set_setpoint(float setpoint_m) {
  protocol::Command command = command_of(rheonaut_Command_set_setpoint_tag);
  command.action.set_setpoint.setpoint_m = setpoint_m;
  return command;
}

protocol::Command set_duty(float duty, std::uint32_t lease_ms) {
  protocol::Command command = command_of(rheonaut_Command_set_duty_tag);
  command.action.set_duty = {duty, lease_ms};
  return command;
}

protocol::Command renew_lease() { return command_of(rheonaut_Command_renew_lease_tag); }

protocol::Command emergency_stop() { return command_of(rheonaut_Command_emergency_stop_tag); }

protocol::Command clear_emergency(std::uint64_t emergency_id) {
  protocol::Command command = command_of(rheonaut_Command_clear_emergency_tag);
  command.action.clear_emergency.emergency_id = emergency_id;
  return command;
}

protocol::Command inject_disturbance(float disturbance_m) {
  protocol::Command command = command_of(rheonaut_Command_inject_disturbance_tag);
  command.action.inject_disturbance.disturbance_m = disturbance_m;
  return command;
}

protocol::Command zero_position() { return command_of(rheonaut_Command_zero_position_tag); }

protocol::Command ping() { return command_of(rheonaut_Command_ping_tag); }

protocol::Command drop_timed() { return command_of(rheonaut_Command_drop_timed_tag); }

protocol::Command timed(protocol::Command command, std::uint64_t execute_at_robot_us) {
  command.has_execute_at_robot_us = true;
  command.execute_at_robot_us = execute_at_robot_us;
  return command;
}

protocol::Command set_controller(const protocol::Controller& controller) {
  protocol::Command command = command_of(rheonaut_Command_set_controller_tag);
  command.action.set_controller = controller;
  return command;
}

protocol::Command restore_controller() { return command_of(rheonaut_Command_restore_controller_tag); }

protocol::Command set_parameter(const char* name, float value) {
  protocol::Command command = command_of(rheonaut_Command_set_parameter_tag);
  auto& order = command.action.set_parameter;
  std::strncpy(order.name, name, sizeof(order.name) - 1);
  order.value = value;
  return command;
}

protocol::Command get_parameters(std::uint32_t first_index) {
  protocol::Command command = command_of(rheonaut_Command_get_parameters_tag);
  command.action.get_parameters.first_index = first_index;
  return command;
}

}  // namespace sim_robot
