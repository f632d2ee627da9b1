// What a model predicts for one run of an experiment, as JSON: stored with the run before it begins.
//
//   {"model": {kp, b1, …}, "model_of": "non_newtonian", "t_s": […], "position_m": […], "position_sd_m": […] or null,
//    "velocity_m_s": […], "duty": […], "setpoint_m": […], "position_min_m", …, "problems": […],
//    "ignores_flow": true where the pump is on}
//
// The model is that of the fluid, or, where the fluid has none, the paper's: `model_of` says which. Pure.
// Errors: std::invalid_argument quoting the bad value.
#pragma once

#include <optional>
#include <string>

#include "control/identification/planned_experiment.hpp"
#include "control/models/plant_models.hpp"
#include "protocol/messages.hpp"
#include "server/experiments/time_line.hpp"

namespace server::experiments {

inline constexpr std::size_t kMostPredicted = 2000;  // points that are kept, equally spaced

struct PredictionRequest {
  Profile profile;
  TimeLine line;
  control::FractionalModel model;
  std::string model_of;  // "non_newtonian", or "(28)" and "(29)" of the paper
  std::optional<control::ExpectedUncertainty> uncertainty;
  protocol::Controller controller;
};

std::string prediction_json(const PredictionRequest& request);

}  // namespace server::experiments
