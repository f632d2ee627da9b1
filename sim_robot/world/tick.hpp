// The step of everything simulated: the period of the robot's loop.
#pragma once

namespace sim_robot {

constexpr double kTickS = 0.01;

}  // namespace sim_robot
