// Shows what a controller does when the world is not as it was tuned for: other gains, other fluid, one-way motor,
// noise.
//
// Each row is one closed-loop prediction of closed_loop.hpp with the controller as the robot would run it. Beside it
// stands whether the loop without any clamp is stable: whether its duty after one impulse of measurement noise dies
// away, to a thousandth within 40 s (2000 to 20 000 periods), and is not growing again. A clamp can hold an unstable
// loop in a limit cycle, and a stable loop that rings for longer than that counts as not stable.
// Errors: throws std::invalid_argument quoting the bad value.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "control/discretisation/discretise.hpp"
#include "control/responses/closed_loop.hpp"

namespace control {

struct RobustnessRow {
  std::string name;  // e.g. "gain +30 %", "water (28)"
  FractionalModel plant;
  double duty_min = -1, duty_max = 1;
  StepMetrics step, disturbance;
  bool is_stable = false;     // of the sampled loop without clamp
  bool is_diverging = false;  // of the prediction, with its clamp
};

struct RobustnessTable {
  // Gains 0.7, 1, 1.3 of the plant, and the Newtonian model with the plant's dead time, each at [-1, 1] and [0, 1].
  std::vector<RobustnessRow> rows;
  // Closed loop at rest, for noise small enough never to be clipped, 1/m. None if that loop is not stable.
  std::optional<double> duty_sd_per_noise_sd;
};

RobustnessTable robustness(const FractionalModel& plant, const Discretisation& controller);

}  // namespace control
