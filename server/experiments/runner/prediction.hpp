// What a model predicts for one run of an experiment, as JSON: stored with the run before it begins.
//
//   {"model": {kp, b1, …}, "model_of": "non_newtonian", "t_s": […], "position_m": […], "position_sd_m": […] or null,
//    "position_sd_parts_m": {"parameters": […], "estimator": […], "sensor": […], "start": […]} or null,
//    "true_position_sd_m": […] or null, "velocity_m_s": […], "duty": […], "setpoint_m": […], "position_min_m", …,
//    "problems": […], "ignores_flow": true where the pump is on}
//
// The band is that of preview_band.hpp: position_sd_m is of the measured position, and null where the uncertainty of
// the model or the robot's parameters are not known.
// The model is that of the fluid, or, where the fluid has none, the paper's: `model_of` says which. Pure.
// Errors: std::invalid_argument quoting the bad value.
#pragma once

#include <optional>
#include <string>

#include "control/identification/planned_experiment.hpp"
#include "control/models/plant_models.hpp"
#include "control/responses/estimator_covariance.hpp"
#include "protocol/messages.hpp"
#include "server/experiments/time_line.hpp"
#include "server/station/state/in_force.hpp"

namespace server::experiments {

inline constexpr std::size_t kMostPredicted = 2000;  // points that are kept, equally spaced

struct PredictionRequest {
  Profile profile;
  TimeLine line;
  control::FractionalModel model;
  std::string model_of;  // "non_newtonian", or "(28)" and "(29)" of the paper
  std::optional<control::ExpectedUncertainty> uncertainty;
  protocol::Controller controller;
  std::optional<control::EstimateParameters> estimate{};  // of the robot
};

std::string prediction_json(const PredictionRequest& request);

// None: the robot has not reported all of them.
std::optional<control::EstimateParameters> estimate_of(const station::ParameterTable& parameters);

}  // namespace server::experiments
