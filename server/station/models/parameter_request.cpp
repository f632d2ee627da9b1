#include "server/station/models/parameter_request.hpp"

#include <cstring>

#include "base/json_text.hpp"

namespace server::station {

CommandRequest set_parameter_request(const RobotId& id, const Author& by, const std::string& name, float value) {
  CommandRequest request;
  request.robot_id = id;
  request.actor = by.actor;
  request.peer = by.peer;
  request.answer_grace = kOwnAnswerGrace;
  request.takes_control = false;  // SAFETY: who named the fluid may be gone by now
  request.action = rheonaut_Command_init_zero;
  request.action.which_action = rheonaut_Command_set_parameter_tag;
  auto& parameter = request.action.action.set_parameter;
  std::strncpy(parameter.name, name.c_str(), sizeof parameter.name - 1);
  parameter.value = value;
  request.arguments = base::dump({{"name", name}, {"value", base::decimal(value)}});
  return request;
}

}  // namespace server::station
