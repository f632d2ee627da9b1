// The way of a command from the request to the robot's link: who may send it, whether it holds, then who is in control.
//
// Loop thread. Emergency stops have a way of their own, see EmergencyStops.
#pragma once

#include <memory>

#include "server/runtime/result.hpp"
#include "server/station/commands/pending_command.hpp"

namespace server::station {

struct RobotEntry;
struct StationParts;

// Checks the request, gives it to the link and publishes it; the sender takes control where the request says so. An
// error means that nothing was sent. What came too late has ended already: its record says expired.
Result<std::shared_ptr<PendingCommand>> dispatch(StationParts& parts, RobotEntry& entry, const CommandRequest& request);

}  // namespace server::station
