// One simulated robot as a program: dials until SIGINT or SIGTERM and says on standard output how its link does.
#pragma once

#include "sim_robot/robot_client.hpp"

namespace sim_robot {

// The exit code.
int run_robot(const SimulatedRobotConfig& config, const StationAddress& station, int handshake_ms);

}  // namespace sim_robot
