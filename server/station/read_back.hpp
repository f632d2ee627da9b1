// Whether what a robot reports to be in force is what commands have ordered. Pure.
//
// A robot writes a report when it sends it, and by then it may have run newer commands as well. It acknowledges all of
// them first.
#pragma once

#include <span>
#include <vector>

#include "server/station/in_force.hpp"
#include "server/station/telemetry_verifier.hpp"

namespace server {

// True for what the robot itself reports after it: a page of parameters, the controller in force.
bool is_read_back(const protocol::Command& command);

// Commands that are read back and that the robot may have run, in the order in which they were sent.
using SentCommands = std::span<const protocol::Command* const>;

// What a page of parameters says of each of them: seen when it answers the command and all is as it was sent, bit for
// bit; overtaken when it holds what a newer one has ordered instead; missed when it holds anything else.
std::vector<Sight> read_back(SentCommands sent, const protocol::ParameterPage& page);

// The same of the controller that the robot reports to be in force.
std::vector<Sight> read_back(SentCommands sent, const protocol::Controller& controller);

}  // namespace server
