#include "server/experiments/runner/prediction.hpp"

#include <fmt/format.h>

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

void add_band(const PredictionRequest& request, const control::ParallelSections& sections, std::size_t every,
              json& out) {
  for (const char* name : {"position_sd_m", "position_sd_parts_m", "true_position_sd_m"}) out[name] = nullptr;
  if (!request.uncertainty || !request.estimate) return;
  const PositionBand band = band_of({request.profile,
                                     request.line,
                                     request.model,
                                     *request.uncertainty,
                                     sections,
                                     {request.controller.duty_min, request.controller.duty_max},
                                     *request.estimate});
  out["position_sd_m"] = thinned(band.sd_m, every);
  out["position_sd_parts_m"] = {{"parameters", thinned(band.parameters_m, every)},
                                {"estimator", thinned(band.estimator_m, every)},
                                {"sensor", thinned(band.sensor_m, every)},
                                {"start", thinned(band.start_m, every)}};
  out["true_position_sd_m"] = thinned(band.true_sd_m, every);
}

}  // namespace

std::optional<control::EstimateParameters> estimate_of(const station::ParameterTable& parameters) {
  bool is_whole = true;
  const auto value = [&](const std::string& name) {
    const std::optional<float> reported = parameters.value(name);
    is_whole = is_whole && reported;
    return static_cast<double>(reported.value_or(0));
  };
  control::EstimateParameters estimate;
  for (std::size_t i = 0; i < control::kEstimateSections; ++i) {
    estimate.gain_m_s[i] = value(fmt::format("model_gain_{}_m_s", i + 1));
    estimate.time_constant_s[i] = value(fmt::format("model_time_constant_{}_s", i + 1));
  }
  estimate.is_confirmed = value("model_confirmed") != 0;
  estimate.gain_error = value("model_gain_error");
  estimate.section_error = value("model_section_error");
  estimate.shape_error = value("model_shape_error");
  estimate.driven_velocity_m_s = value("driven_velocity_sd_m_s");
  estimate.resting_velocity_m_s = value("resting_velocity_sd_m_s");
  estimate.correlation_s = value("velocity_correlation_s");
  estimate.noise_m_s2 = value("acceleration_noise_m_s2");
  estimate.bias_m_s2 = value("acceleration_bias_m_s2");
  estimate.bias_walk_m_s2 = value("acceleration_bias_walk_m_s2");
  return is_whole ? std::optional{estimate} : std::nullopt;
}

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
  add_band(request, sections, every, out);
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
