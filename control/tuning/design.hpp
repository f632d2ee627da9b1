// A tuning specification, and a controller that meets one, with what it achieves.
#pragma once

#include <optional>
#include <string>

#include "control/responses/margins.hpp"

namespace control {

struct TuningSpec {
  double gain_crossover_rad_s = 5;
  double phase_margin_deg = 91;             // in (0, 180)
  std::optional<double> mu = std::nullopt;  // in (0, 2); fixed: iso-damping is dropped, and (3), (6) alone are met
  bool is_velocity_loop = false;
  double period_s = 0;  // of the robot that runs it, which holds its duty so long; 0: not sampled, as in the paper
};

// A specification that has a solution, and the controller for it.
struct TunedController {
  std::string name;  // in words: what was kept and what was given up, and what else is to be known of it
  TuningSpec spec;   // tuning to this returns this controller
  FopdController controller;
  Margins achieved;  // of the continuous loop, computed from the controller's own numbers
  Margins sampled;   // as the robot runs it: of the plant with_hold
};

// From this kd ω^μ on, at its crossover, a controller is named as nearly all derivative. The paper's has 0.1 at 6
// rad/s.
inline constexpr double kMuchDerivative = 10;

// A sentence about a controller with more than that, for its name and beside it; empty: none.
std::string remark_on(const FopdController& controller, double gain_crossover_rad_s);

// The plant as a controller of this period drives it: a duty that is held for T comes T/2 late in the mean,
//   (1 - e^(-sT))/(sT) ≈ e^(-sT/2)       modulus within (ωT)²/24: 1.8 % at ωT = 0.65
FractionalModel with_hold(FractionalModel plant, double period_s);

// The closed loop is stable, also as the robot runs it, and the crossover of the specification is the one with the
// smallest phase margin.
bool is_sound(const TunedController& design);

// Another crossover than that of the specification has the smallest phase margin.
bool is_ruled_elsewhere(const TunedController& design);

}  // namespace control
