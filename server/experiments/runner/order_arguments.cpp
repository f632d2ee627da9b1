#include "server/experiments/runner/order_arguments.hpp"

#include <nlohmann/json.hpp>

#include "base/json_text.hpp"

namespace server::experiments {
namespace {

using nlohmann::json;

json schedule_json(const rheonaut_SetDutySchedule& order) {
  json entries = json::array();
  for (pb_size_t i = 0; i < order.tick_count; ++i)
    entries.push_back({{"tick", order.tick[i]}, {"duty", base::decimal(order.duty[i])}});
  return entries;
}

json json_of(const protocol::Command& command) {
  const auto& action = command.action;
  switch (command.which_action) {
    case rheonaut_Command_set_mode_tag:
      if (action.set_mode.mode != rheonaut_MODE_AUTO) return {{"mode", "manual"}};
      return {{"mode", "auto"}, {"setpoint_m", base::decimal(action.set_mode.setpoint_m)}};
    case rheonaut_Command_set_setpoint_tag: return {{"setpoint_m", base::decimal(action.set_setpoint.setpoint_m)}};
    case rheonaut_Command_inject_disturbance_tag:
      return {{"disturbance_m", base::decimal(action.inject_disturbance.disturbance_m)}};
    case rheonaut_Command_set_duty_schedule_tag: return {{"schedule", schedule_json(action.set_duty_schedule)}};
    default: return json::object();
  }
}

}  // namespace

std::string arguments_of(const protocol::Command& command) {
  json arguments = json_of(command);
  if (command.has_execute_at_robot_us) arguments["execute_at_robot_us"] = command.execute_at_robot_us;
  return base::dump(arguments);
}

}  // namespace server::experiments
