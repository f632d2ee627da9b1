#include "server/experiments/adaptive/fitted_model.hpp"

#include "control/identification/identifiability.hpp"
#include "server/analysis/control_json.hpp"
#include "server/runtime/exceptions.hpp"

namespace server::experiments {
using nlohmann::json;

bool is_at_bound(const FittedModel& fitted, std::size_t parameter) {
  const control::FractionalModel model = control::normalised(fitted.model);
  return fitted.one_sigma[parameter] && control::lies_at_bound(parameter, control::parameters_of(model)[parameter]);
}

Result<FittedModel> fitted_model_from(storage::JobId job, const json& result) {
  try {
    FittedModel fitted;
    fitted.job = job;
    if (!result.at("residual_sd").is_number()) return fail(ErrorCode::invalid, "no model fits the runs", "no_model");
    const auto model = analysis::model_from(result.at("parameters"));
    if (!model) return std::unexpected{model.error()};
    fitted.model = *model;
    fitted.end = result.at("end").get<std::string>();
    const bool is_optimum = fitted.end == analysis::text(control::SearchEnd::converged);
    const json widening = result.contains("widening") ? result.at("widening") : json(1);  // an earlier version's
    for (std::size_t i = 0; is_optimum && widening.is_number() && i < control::kParameters; ++i) {
      const json& sigma = result.at("one_sigma").at(control::kParameterNames[i]);
      if (sigma.is_number()) fitted.one_sigma[i] = sigma.get<double>() * widening.get<double>();
    }
    fitted.residual_sd = result.at("residual_sd").get<double>();
    fitted.fit_percent = result.at("fit_percent").get<double>();
    const json& of_channels = result.contains("runs") ? result.at("runs").at(0) : result;
    fitted.is_of_acceleration = of_channels.at("channels").at(0) == "acceleration_m_s2";
    fitted.warnings = result.at("warnings").get<std::vector<std::string>>();
    for (const json& run : result.value("runs", json::array())) {  // of one run each
      for (const json& warning : run.value("warnings", json::array())) {
        fitted.warnings.push_back("run " + run.value("run_id", json()).dump() + ": " + warning.get<std::string>());
      }
    }
    return fitted;
  } catch (const json::exception& error) {
    return fail(ErrorCode::invalid, std::string{"the result of the fit cannot be read: "} + runtime::text_of(error),
                "no_model");
  }
}

json to_json(const FittedModel& fitted) {
  json sigma = json::object();
  for (std::size_t i = 0; i < control::kParameters; ++i) {
    sigma[control::kParameterNames[i]] = fitted.one_sigma[i] ? json(*fitted.one_sigma[i]) : json(nullptr);
  }
  return {{"job_id", fitted.job},
          {"parameters", json(analysis::json_of(fitted.model))},
          {"one_sigma", std::move(sigma)},
          {"end", fitted.end},
          {"fit_percent", fitted.fit_percent},
          {"residual_sd", fitted.residual_sd},
          {"warnings", fitted.warnings}};
}

}  // namespace server::experiments
