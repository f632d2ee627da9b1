// How a controller becomes discrete, for the command line and for jobs.
//
// Errors: throws std::invalid_argument, or std::runtime_error when nothing comes out stable: control/discretisation.
#pragma once

#include <optional>

#include "control/discretisation/discretise.hpp"
#include "server/analysis/control_json.hpp"

namespace server::analysis {

struct Sampling {
  double period_s = 0.01;
  int order = 5;
  std::optional<control::DiscretisationMethod> method;  // neither method nor a: several are tried
  std::optional<double> a;
  double bandwidth_rad_s = 30;
};

// The chosen one, why it was chosen, and what was tried.
control::DiscretisationChoice discretised(const control::FopdController& controller, const Sampling& sampling);

// For a robot whose motor turns both ways, or forwards only. The latter takes the direct method with a = 0: any other
// gives the motor a tick forwards when the setpoint lies behind the robot.
Sampling sampling_for(double period_s, bool is_one_way);

}  // namespace server::analysis
