// Writes identifications, discretisations and predictions; the names of their choices.
#include "server/analysis/control_json.hpp"
#include "server/analysis/optional_json.hpp"

namespace server::analysis {
namespace {

using Sigmas = std::array<std::optional<double>, control::kParameters>;

OrderedJson named(const Sigmas& sigmas) {
  OrderedJson out;
  for (std::size_t i = 0; i < sigmas.size(); ++i) out[control::kParameterNames[i]] = or_null(sigmas[i]);
  return out;
}

OrderedJson json_of(const control::SensorFit& sensor) {
  return {{"readings_are_recovered", sensor.readings_are_recovered},
          {"has_own_clock", sensor.has_own_clock},
          {"period_s", sensor.period_s},
          {"time_constant_s", sensor.time_constant_s},
          {"delay_s", sensor.delay_s},
          {"bias_m_s2", sensor.bias_m_s2},
          {"bias_range_m_s2", sensor.bias_range_m_s2},
          {"readings_left_out", sensor.readings_left_out}};
}

OrderedJson json_of(const control::DiscretisationErrors& errors) {
  return {{"band_low_rad_s", errors.band_low_rad_s},
          {"band_high_rad_s", errors.band_high_rad_s},
          {"max_db", errors.max_db},
          {"max_deg", errors.max_deg},
          {"rms_relative", errors.rms_relative},
          {"bandwidth_rad_s", errors.bandwidth_rad_s},
          {"max_relative_in_bandwidth", errors.max_relative_in_bandwidth},
          {"max_deg_in_bandwidth", errors.max_deg_in_bandwidth},
          {"fit_max_relative", errors.fit_max_relative}};
}

}  // namespace

const char* text(control::Structure value) {
  switch (value) {
    case control::Structure::fractional: return "fractional";
    case control::Structure::second_order: return "second_order";
    case control::Structure::first_order: return "first_order";
  }
  return "unknown";
}

const char* text(control::Cost value) {
  return value == control::Cost::least_squares ? "least_squares" : "absolute_error";
}

const char* text(control::SearchEnd value) {
  switch (value) {
    case control::SearchEnd::converged: return "converged";
    case control::SearchEnd::iteration_limit: return "iteration_limit";
    case control::SearchEnd::time_limit: return "time_limit";
    case control::SearchEnd::cancelled: return "cancelled";
    case control::SearchEnd::not_finite: return "not_finite";
  }
  return "unknown";
}

const char* text(control::DiscretisationMethod value) {
  return value == control::DiscretisationMethod::direct ? "direct" : "oustaloup";
}

OrderedJson json_of(const control::Fit& fit) {
  return {{"structure", text(fit.structure)},
          {"parameters", json_of(fit.model)},
          {"one_sigma", named(fit.one_sigma)},
          {"sse", fit.sse},
          {"fit_percent", fit.fit_percent},
          {"residual_sd", fit.residual_sd},
          {"absolute_error", fit.absolute_error},
          {"offset_m", fit.offset_m},
          {"offset_sigma_m", or_null(fit.offset_sigma_m)},
          {"dead_time_s", fit.model.dead_time_s},
          {"dead_time_sigma_s", or_null(fit.dead_time_sigma_s)},
          {"position_clock_s", fit.position_clock_s},
          {"position_clock_sigma_s", or_null(fit.position_clock_sigma_s)},
          {"aic", fit.aic},
          {"free_parameters", fit.free_parameters},
          {"residuals_are_white", fit.residuals_are_white},
          {"whiteness_p_value", fit.whiteness_p_value},
          {"drift_factor", fit.drift_factor},
          {"colour_factor", fit.colour_factor},
          {"position_whiteness_p_value", or_null(fit.position_whiteness_p_value)},
          {"velocity_whiteness_p_value", or_null(fit.velocity_whiteness_p_value)},
          {"acceleration_whiteness_p_value", or_null(fit.acceleration_whiteness_p_value)},
          {"sensor", fit.sensor ? json_of(*fit.sensor) : OrderedJson(nullptr)},
          {"correlation_of", control::kParameterNames},
          {"correlation", fit.correlation},
          {"end", text(fit.end)},
          {"iterations", fit.iterations},
          {"starts", fit.starts},
          {"starts_that_agree", fit.starts_that_agree}};
}

OrderedJson json_of(const control::Identification& identification) {
  OrderedJson out = json_of(identification.best);
  out["warnings"] = identification.warnings;
  out["doubts"] = json_of(identification.doubts);
  out["widening"] = or_null(control::widening(identification.doubts));
  out["compared"] = OrderedJson::array();
  for (const control::Fit& fit : identification.compared) out["compared"].push_back(json_of(fit));
  return out;
}

OrderedJson json_of(const control::ExpectedUncertainty& uncertainty) {
  return {{"one_sigma", named(uncertainty.one_sigma)},
          {"correlation_of", control::kParameterNames},
          {"correlation", uncertainty.correlation}};
}

OrderedJson json_of(const control::ParallelSections& sections) {
  OrderedJson out = {
      {"direct", sections.direct}, {"first_order", OrderedJson::array()}, {"second_order", OrderedJson::array()}};
  for (const auto& section : sections.first_order) {
    out["first_order"].push_back({{"pole", section.pole}, {"residue", section.residue}});
  }
  for (const auto& section : sections.second_order) {
    out["second_order"].push_back({{"b0", section.b0}, {"b1", section.b1}, {"a1", section.a1}, {"a2", section.a2}});
  }
  return out;
}

OrderedJson json_of(const control::Discretisation& d) {
  const bool is_direct = d.options.method == control::DiscretisationMethod::direct;
  return {{"numerator", d.transfer ? OrderedJson(d.transfer->numerator) : OrderedJson(nullptr)},
          {"denominator", d.transfer ? OrderedJson(d.transfer->denominator) : OrderedJson(nullptr)},
          {"sections", json_of(d.sections)},
          {"dc_gain", d.dc_gain},
          {"errors", json_of(d.errors)},
          {"period_s", d.options.period_s},
          {"order", d.options.order},
          {"method", text(d.options.method)},
          {"a", is_direct ? OrderedJson(d.options.a) : OrderedJson(nullptr)},
          {"dc_gain_before", d.dc_gain_before},
          {"is_stable", d.is_stable},
          {"is_minimum_phase", d.is_minimum_phase},
          {"largest_pole", d.largest_pole},
          {"largest_zero", d.largest_zero},
          {"noise_gain", d.noise_gain},
          {"float32_rms_duty", d.float32_rms_duty},
          {"transfer_max_relative", d.transfer_max_relative},
          {"transfer_note", d.transfer ? OrderedJson(nullptr) : OrderedJson(d.transfer_note)}};
}

OrderedJson json_of(const control::StepMetrics& metrics) {
  return {{"settling_s", or_null(metrics.settling_s)},
          {"overshoot_percent", metrics.overshoot_percent},
          {"peak_m", metrics.peak_m},
          {"rise_10_90_s", or_null(metrics.rise_10_90_s)},
          {"steady_state_error_m", metrics.steady_state_error_m}};
}

OrderedJson json_of(const control::ClosedLoopPrediction& prediction) {
  return {{"step", json_of(prediction.step)},
          {"disturbance", json_of(prediction.disturbance)},
          {"duty_sd_at_rest", prediction.duty_sd_at_rest},
          {"clipped_fraction", prediction.clipped_fraction},
          {"is_diverging", prediction.is_diverging},
          {"t_s", prediction.time_s},
          {"position_m", prediction.position_m},
          {"velocity_m_s", prediction.velocity_m_s},
          {"measured_m", prediction.measured_m},
          {"duty", prediction.duty},
          {"reference_m", prediction.reference_m}};
}

OrderedJson json_of(const control::RobustnessTable& table) {
  OrderedJson out = {{"rows", OrderedJson::array()}, {"duty_sd_per_noise_sd", or_null(table.duty_sd_per_noise_sd)}};
  for (const control::RobustnessRow& row : table.rows) {
    out["rows"].push_back({{"name", row.name},
                           {"plant", json_of(row.plant)},
                           {"duty_min", row.duty_min},
                           {"duty_max", row.duty_max},
                           {"step", json_of(row.step)},
                           {"disturbance", json_of(row.disturbance)},
                           {"is_stable", row.is_stable},
                           {"is_diverging", row.is_diverging}});
  }
  return out;
}

}  // namespace server::analysis
