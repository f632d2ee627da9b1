// How far the position that a robot measures may be from the predicted one: the band of a prediction.
//
//   sd² = parameters² + estimator² + sensor² + start²                                                          (1)
//   parameters² = Σ_ij ρ_ij d_i d_j + d_T²,  d_i = σ_i ∂x/∂θ_i,  d_T of the dead time                          (2)
//   the others: control/responses/measured_spread.hpp                                                         (3)
//
// It is about the measured position: the robot's own estimate without the disturbance, as telemetry has it and the loop
// controls it. "± 2 sd" is twice sd. The true position differs from the measured one by the error of the estimate,
// which the loop does not see: true_sd_m has (3) of the true position in place of the measured one.
// σ and ρ are those of the model's fit, widened by its doubts; derivatives are differences of two predictions with the
// duty range of the controller. First order: true where the position is nearly straight in what is uncertain. That the
// estimator's own model is from the same fit, which draws the measured position to the predicted one, is not counted.
// Not in it: flow, and what no such model describes. Pure. Errors: throws std::invalid_argument quoting the bad value.
#pragma once

#include <vector>

#include "control/identification/planned_experiment.hpp"
#include "control/responses/estimator_covariance.hpp"
#include "server/experiments/preview.hpp"

namespace server::experiments {

struct DutyRange {
  double min = -1, max = 1;  // of the controller
};

// `parameters` of (1) alone: one sd for each sample of preview_of() with the same arguments.
std::vector<double> parameters_sd_of(const Profile& profile, const TimeLine& line,
                                     const control::FractionalModel& plant,
                                     const control::ExpectedUncertainty& uncertainty,
                                     const control::ParallelSections& controller, DutyRange duty = {});

struct BandRequest {
  Profile profile;
  TimeLine line;
  control::FractionalModel plant;
  control::ExpectedUncertainty uncertainty;
  control::ParallelSections controller;
  DutyRange duty;
  control::EstimateParameters estimate;  // of the robot
};

// Standard deviations in m, one for each sample of the prediction.
struct PositionBand {
  std::vector<double> sd_m;                                          // of the measured position: (1)
  std::vector<double> parameters_m, estimator_m, sensor_m, start_m;  // what it is made of
  std::vector<double> true_sd_m;
};

PositionBand band_of(const BandRequest& request);

// The estimator of a robot that is sent this model by a station: confirmed, or in grave doubt only assumed. Where four
// sections do not follow it, the robot keeps that of (29). Takes up to 0.2 s.
control::EstimateParameters estimate_with(const control::FractionalModel& plant, bool is_in_grave_doubt);

}  // namespace server::experiments
