#include "server/experiments/runner/prediction.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "server/analysis/control_json.hpp"
#include "server/analysis/tuning/robot_controller.hpp"
#include "server/experiments/preview_band.hpp"

namespace server::experiments {
namespace {

using nlohmann::json;

json thinned(const std::vector<double>& values, std::size_t every) {
  json list = json::array();
  for (std::size_t i = 0; i < values.size(); i += every) {
    list.push_back(std::isfinite(values[i]) ? json(values[i]) : json(nullptr));
  }
  return list;
}

}  // namespace

std::string prediction_json(const PredictionRequest& request) {
  const control::ParallelSections sections = analysis::sections_of(request.controller);
  const Preview preview = preview_of(request.profile, request.line, request.model, sections,
                                     request.controller.duty_min, request.controller.duty_max);
  const std::size_t every = (preview.time_s.size() + kMostPredicted - 1) / kMostPredicted;
  json out;
  out["model"] = analysis::json_of(request.model);
  out["model_of"] = request.model_of;
  out["t_s"] = thinned(preview.time_s, every);
  out["position_m"] = thinned(preview.position_m, every);
  out["position_sd_m"] = nullptr;
  if (request.uncertainty) {
    const std::vector<double> sd_m =
        position_sd_of(request.profile, request.line, request.model, *request.uncertainty, sections);
    out["position_sd_m"] = thinned(sd_m, every);
  }
  out["velocity_m_s"] = thinned(preview.velocity_m_s, every);
  out["duty"] = thinned(preview.duty, every);
  out["setpoint_m"] = thinned(preview.setpoint_m, every);
  out["position_min_m"] = preview.position_min_m;
  out["position_max_m"] = preview.position_max_m;
  out["travel_m"] = preview.travel_m;
  out["problems"] = preview.problems;
  out["ignores_flow"] = request.profile.conditions.pump != PumpFlow::off;
  return out.dump();
}

}  // namespace server::experiments
