// Shows what a controller does when the world is not as it was tuned for: other gains, other fluid, one-way motor,
// noise.
//
// Each row is one closed-loop prediction of closed_loop.hpp with the controller as the robot would run it.
// Errors: throws std::invalid_argument quoting the bad value.
#pragma once

#include <string>
#include <vector>

#include "control/closed_loop.hpp"
#include "control/discretise.hpp"

namespace control {

struct RobustnessRow {
  std::string name;  // e.g. "gain +30 %", "water (28)"
  FractionalModel plant;
  double duty_min = -1, duty_max = 1;
  StepMetrics step, disturbance;
};

struct RobustnessTable {
  std::vector<RobustnessRow> rows;  // gains 0.7, 1, 1.3 of the plant and the Newtonian model, each at [-1,1] and [0,1]
  double duty_sd_per_noise_sd = 0;  // closed loop at rest, for noise small enough never to be clipped, 1/m
};

RobustnessTable robustness(const FractionalModel& plant, const Discretisation& controller);

}  // namespace control
