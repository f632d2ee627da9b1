// Every key of a scenario, every fault and every command of a script as Markdown, for docs/scenarios.md.
#pragma once

#include <string>

namespace sim_robot {

std::string scenario_tables();

}  // namespace sim_robot
