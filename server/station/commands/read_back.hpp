// Compares the values that a robot reports to be in force with those that commands have set. Pure.
//
// A robot writes a report when it sends it, and by then it may have run newer commands as well. It acknowledges all of
// them first.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "server/station/commands/telemetry_verifier.hpp"
#include "server/station/state/in_force.hpp"

namespace server::station {

// True for what the robot itself reports after it: a page of parameters, the controller in force.
bool is_read_back(const protocol::Command& command);

// Commands that are read back and that the robot may have run, in the order in which they were sent.
using SentCommands = std::span<const protocol::Command* const>;

// What a page of parameters says of each of them: seen when it answers the command and all is as it was sent, bit for
// bit; overtaken when it holds what a newer one has ordered instead; missed when it holds anything else.
std::vector<Sight> read_back(SentCommands sent, const protocol::ParameterPage& page);

struct ControllerReading {
  std::vector<Sight> sights;                   // of each command
  std::optional<protocol::Controller> former;  // that restore_controller brings back now; none: not known
};

// What the controller that the robot reports to be in force says of each of them, and of the one behind it, given what
// was known before: seen when it is the one that the command brings, bit for bit; overtaken when a newer command has
// brought it; missed when it is neither, nor the one that was in force. What a restore brings and the station has not
// seen go is any that no other command has ordered.
ControllerReading read_back(SentCommands sent, const RobotSettings& known, const protocol::Controller& reported);

}  // namespace server::station
