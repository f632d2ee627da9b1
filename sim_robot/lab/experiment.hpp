// The paper's closed-loop experiment (its Figure 7) in virtual time, on the core that also runs on the robot.
//
// Auto with setpoint 0.1 m at t = 0; from t = 20 s on the measured position is shifted by -0.05 m; 40 s in all.
#pragma once

#include <vector>

#include "control/responses/step_metrics.hpp"
#include "sim_robot/robot/simulated_robot.hpp"

namespace sim_robot {

struct ExperimentResult {
  std::vector<double> time_s, position_m, duty;  // one entry per sample, as telemetry brought them
  control::StepMetrics step;
  control::StepMetrics disturbance;  // overshoot in percent of the 0.05 m move, band ±2 mm
};

ExperimentResult run_experiment(const SimulatedRobotConfig& config);

}  // namespace sim_robot
