// Predicts a closed-loop experiment: sampled controller, clamp, profile, disturbance, measurement noise.
//
//   e[k] = r[k] - (x[k] + disturbance[k] + noise[k]),  u[k] = clamp(G(z) e)[k],  x from the plant under u held     (1)
//   x measured at kT, u applied from kT on: no computational delay                                               (2)
//
// Samples k = 0 .. duration/T, both included. The settling band is the same for the step and for the disturbance.
// A loop whose measured position leaves 1000 times the largest of setpoint, disturbance and noise diverges: the record
// ends there, what is measured is of the record so far, and nothing of it has settled.
// Errors: throws std::invalid_argument quoting the bad value.
#pragma once

#include <cstdint>
#include <vector>

#include "control/models/plant_models.hpp"
#include "control/responses/sections.hpp"
#include "control/responses/step_metrics.hpp"

namespace control {

struct ClosedLoopExperiment {
  FractionalModel plant;
  ParallelSections controller;
  double period_s = 0.01;
  double duration_s = 40;
  double setpoint_m = 0.1;
  double duty_min = -1, duty_max = 1;  // infinite for no clamp
  double disturbance_m = -0.05;        // added to the measured position from disturbance_at_s on
  double disturbance_at_s = 20;        // beyond duration_s for none
  double profile_velocity_m_s = 0;     // limits of the reference; 0 for a plain step
  double profile_acceleration_m_s2 = 0;
  double noise_sd_m = 0;  // white, on the measured position
  std::uint64_t noise_seed = 1;
  double settling_band_m = 0;  // 0: 2 % of the setpoint
};

struct ClosedLoopPrediction {
  std::vector<double> time_s, position_m, velocity_m_s, measured_m, duty, reference_m;
  StepMetrics step;             // up to the disturbance, of the noise-free measured position; empty for setpoint 0
  StepMetrics disturbance;      // after it, back from setpoint + disturbance; empty without one
  bool is_diverging = false;    // the record is shorter than asked for
  double duty_sd_at_rest = 0;   // over the last quarter before the disturbance
  double clipped_fraction = 0;  // of all samples
};

ClosedLoopPrediction predict_closed_loop(const ClosedLoopExperiment& experiment);

}  // namespace control
