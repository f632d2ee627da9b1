// The flow that an experiment needs, and whether the pump drives it already. Pure.
#pragma once

#include <optional>
#include <string>

#include "server/experiments/profile.hpp"
#include "server/storage/runs/run.hpp"

namespace server::experiments {

// "off", or e.g. "constant, mean 0.04 m/s".
std::string flow_text(const Conditions& conditions);

// What a person must set before a run in these conditions, in words; none: the pump drives this flow already. `last`
// is the conditions of the robot's newest run that states a flow; without one the pump counts as off.
std::optional<std::string> flow_to_set(const Conditions& conditions, const std::optional<storage::RunConditions>& last);

}  // namespace server::experiments
