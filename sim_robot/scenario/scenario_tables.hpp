// Every key of a scenario, every fault and every command of a script as Markdown: what docs/scenarios.md holds.
#pragma once

#include <string>

namespace sim_robot {

std::string scenario_tables();

}  // namespace sim_robot
