// The command that sets a parameter of a robot on behalf of the actor that named its fluid.
#pragma once

#include <string>

#include "server/station/commands/requests.hpp"
#include "server/station/state/audit_note.hpp"

namespace server::station {

CommandRequest set_parameter_request(const RobotId& id, const Author& by, const std::string& name, float value);

}  // namespace server::station
