// The result of the paper's closed-loop experiment in virtual time, as a table or as JSON.
#pragma once

#include <string>

#include "sim_robot/robot/simulated_robot.hpp"

namespace sim_robot {

// With a perfect sensor, whatever the config says. JSON keys: duty_min, duty_max, settling_s, overshoot_percent,
// steady_state_error_m and the same with disturbance_ in front; settling is null when the robot never settles.
std::string predict(SimulatedRobotConfig config, bool as_json);

}  // namespace sim_robot
