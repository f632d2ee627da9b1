// Reads models and controllers strictly; writes models, margins and tunings.
#include "server/analysis/control_json.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <stdexcept>

#include "control/models/modal_form.hpp"
#include "server/analysis/optional_json.hpp"

namespace server::analysis {

using nlohmann::json;

namespace {

constexpr std::size_t kMaxQuotedValue = 60;

// Arrays and objects are only named: writing one that is nested 100 000 deep would exhaust the stack.
std::string quote(const json& value) {
  if (value.is_structured()) return value.is_array() ? "an array" : "an object";
  std::string text = value.dump(-1, ' ', false, json::error_handler_t::replace);
  if (text.size() > kMaxQuotedValue) text = text.substr(0, kMaxQuotedValue) + "...";
  return text;
}

std::string list(std::initializer_list<const char*> names) { return fmt::format("{}", fmt::join(names, ", ")); }

bool is_remark(const std::string& key) { return key == "name" || key == "comment" || key == "description"; }

Result<void> only(const json& object, const char* what, std::initializer_list<const char*> keys) {
  for (const auto& [key, value] : object.items()) {
    const bool known = std::ranges::any_of(keys, [&key](const char* other) { return key == other; });
    if (!known && !is_remark(key)) {
      return fail(ErrorCode::bad_request,
                  fmt::format("key {} = {} is not known in a {}; it has {}, and may have a name, comment, description",
                              quote(key), quote(value), what, list(keys)),
                  "unknown_member");
    }
  }
  return {};
}

struct Key {
  const char* name;
  double* value;
  bool is_required = true;
};

Result<void> read_numbers(const json& object, const char* what, std::initializer_list<Key> keys) {
  for (const Key& key : keys) {
    const auto found = object.find(key.name);
    if (found == object.end()) {
      if (!key.is_required) continue;
      return fail(ErrorCode::bad_request, fmt::format("key \"{}\" is missing, a {} needs it", key.name, what),
                  "missing_member");
    }
    if (!found->is_number() || !std::isfinite(found->get<double>())) {
      return fail(ErrorCode::bad_request,
                  fmt::format("key \"{}\" = {} is not a number; give a finite one", key.name, quote(*found)),
                  "wrong_type");
    }
    *key.value = found->get<double>();
  }
  return {};
}

std::unexpected<Error> not_an_object(const json& value, const char* what, const char* example) {
  return fail(ErrorCode::bad_request,
              fmt::format("{} is not a {}; give an object such as {}", quote(value), what, example), "wrong_type");
}

template <class T>
Result<T> checked(const T& value) {
  try {
    control::check(value);
    return value;
  } catch (const std::invalid_argument& error) {
    return fail(ErrorCode::invalid, error.what());
  }
}

// The double that is written as the float is: 0.1, not 0.10000000149011612. It is the same float again.
double as_written(float value) { return std::stod(fmt::format("{}", value)); }

// What an identification found stands beside its parameters, too; that of earlier versions stands only there.
Result<void> read_dead_time_of_fit(const json& fit, bool is_in_parameters, control::FractionalModel& model) {
  double beside_s = model.dead_time_s;
  if (auto read = read_numbers(fit, "fit", {{"dead_time_s", &beside_s, false}}); !read) return read;
  if (is_in_parameters && beside_s != model.dead_time_s) {
    return fail(ErrorCode::invalid, fmt::format("\"dead_time_s\" is {} in \"parameters\" and {} beside them; leave one",
                                                model.dead_time_s, beside_s));
  }
  model.dead_time_s = beside_s;
  return {};
}

OrderedJson complex_json(control::Complex value) { return {{"real", value.real()}, {"imaginary", value.imag()}}; }

}  // namespace

Result<control::FractionalModel> model_from(const json& given) {
  const bool is_of_a_fit = given.is_object() && given.contains("parameters");
  const json& value = is_of_a_fit ? given.at("parameters") : given;
  if (!value.is_object()) {
    return not_an_object(value, "model",
                         R"({"kp":0.1,"b1":0.005682,"b2":0.11031,"b3":1,"alpha":1.7263,"beta":0.8682})");
  }
  control::FractionalModel model;
  if (auto known = only(value, "model", {"kp", "b1", "b2", "b3", "alpha", "beta", "dead_time_s"}); !known) {
    return std::unexpected{known.error()};
  }
  model.b3 = 1;
  auto read = read_numbers(value, "model",
                           {{"kp", &model.kp},
                            {"b1", &model.b1},
                            {"b2", &model.b2},
                            {"b3", &model.b3, false},
                            {"alpha", &model.alpha},
                            {"beta", &model.beta},
                            {"dead_time_s", &model.dead_time_s, false}});
  if (!read) return std::unexpected{read.error()};
  if (is_of_a_fit) {
    if (auto found = read_dead_time_of_fit(given, value.contains("dead_time_s"), model); !found) {
      return std::unexpected{found.error()};
    }
  }
  return checked(model);
}

Result<std::optional<control::ExpectedUncertainty>> uncertainty_from(const json& fit) {
  if (!fit.is_object() || !fit.contains("one_sigma")) return std::nullopt;
  const auto doubted = doubts_from(fit);
  if (!doubted) return std::unexpected{doubted.error()};
  const std::optional<double> widening = control::widening(doubted->doubts);
  if (!widening) return std::nullopt;
  try {
    control::ExpectedUncertainty known;
    const std::string structure = fit.at("structure");
    const bool is_fractional = structure == text(control::Structure::fractional);
    const bool has_b1 = structure != text(control::Structure::first_order);
    const std::array<bool, control::kParameters> is_free{true, has_b1, true, is_fractional, is_fractional};
    for (std::size_t i = 0; i < control::kParameters; ++i) {
      if (!is_free[i]) continue;
      const json& sigma = fit.at("one_sigma").at(control::kParameterNames[i]);
      if (sigma.is_null()) return std::nullopt;
      known.one_sigma[i] = sigma.get<double>();
      if (!(*known.one_sigma[i] >= 0)) {
        return fail(ErrorCode::invalid, fmt::format("one_sigma of {} is {}, it must not be negative",
                                                    control::kParameterNames[i], *known.one_sigma[i]));
      }
      *known.one_sigma[i] *= *widening;
    }
    known.correlation = fit.at("correlation").get<decltype(known.correlation)>();
    const json& searched = fit.value("dead_time_sigma_s", json{});
    known.dead_time_sd_s =
        std::hypot(searched.is_null() ? 0 : searched.get<double>() * *widening, dead_time_sd_s(doubted->doubts));
    return known;
  } catch (const json::exception&) {
    return fail(
        ErrorCode::bad_request,
        "the uncertainty is not as identify prints it: \"structure\", \"one_sigma\" by name, \"correlation\" 5 by 5",
        "wrong_type");
  }
}

Result<control::FopdController> controller_from(const json& value) {
  if (!value.is_object()) return not_an_object(value, "controller", R"({"kp":65.0028,"kd":0.0305,"mu":0.6524})");
  if (const auto feasible = value.find("feasible"); feasible == value.end()) {
    if (auto known = only(value, "controller", {"kp", "kd", "mu"}); !known) return std::unexpected{known.error()};
  } else if (*feasible == false) {
    return fail(ErrorCode::invalid, "it holds no controller: the tuning was not feasible; see its \"reason\"");
  }
  control::FopdController controller;
  auto read =
      read_numbers(value, "controller", {{"kp", &controller.kp}, {"kd", &controller.kd}, {"mu", &controller.mu}});
  if (!read) return std::unexpected{read.error()};
  return checked(controller);
}

OrderedJson json_of(const control::FractionalModel& model) {
  return {{"kp", model.kp},
          {"b1", model.b1},
          {"b2", model.b2},
          {"b3", model.b3},
          {"alpha", model.alpha},
          {"beta", model.beta},
          {"dead_time_s", model.dead_time_s}};
}

OrderedJson json_of(const control::FopdController& controller) {
  return {{"kp", controller.kp}, {"kd", controller.kd}, {"mu", controller.mu}};
}

OrderedJson json_of(const control::HydrodynamicParameters& p) {
  return {{"thrust_coefficient", p.thrust_coefficient},
          {"drag_coefficient", p.drag_coefficient},
          {"propeller_diameter_m", p.propeller_diameter_m},
          {"propeller_radius_m", p.propeller_radius_m},
          {"blade_area_m2", p.blade_area_m2},
          {"fluid_density_kg_m3", p.fluid_density_kg_m3},
          {"frontal_area_m2", p.frontal_area_m2},
          {"added_mass_coefficient", p.added_mass_coefficient},
          {"flow_velocity_m_s", p.flow_velocity_m_s},
          {"mass_kg", p.mass_kg},
          {"operating_velocity_m_s", p.operating_velocity_m_s},
          {"motor_gain_rad_s", p.motor.gain_rad_s},
          {"motor_time_constant_s", p.motor.time_constant_s},
          {"numerator", p.numerator}};
}

OrderedJson json_of(const control::HydrodynamicModel& model) {
  return {{"model", json_of(model.model)},
          {"derived_numerator", model.derived_numerator},
          {"total_mass_kg", model.total_mass_kg},
          {"damping_kg_s", model.damping_kg_s},
          {"linear_drag_kg_s", model.linear_drag_kg_s},
          {"quadratic_drag_kg_m", model.quadratic_drag_kg_m}};
}

OrderedJson json_of(const control::MotorFit& fit) {
  return {{"gain_rad_s", fit.motor.gain_rad_s},
          {"time_constant_s", fit.motor.time_constant_s},
          {"gain_sigma_rad_s", fit.gain_sigma_rad_s},
          {"time_constant_sigma_s", fit.time_constant_sigma_s},
          {"sse", fit.sse},
          {"fit_percent", fit.fit_percent},
          {"residual_sd_rad_s", fit.residual_sd_rad_s}};
}

OrderedJson json_of(const control::Margins& margins) {
  return {{"gain_crossover_rad_s", or_null(margins.gain_crossover_rad_s)},
          {"phase_margin_deg", or_null(margins.phase_margin_deg)},
          {"phase_slope_deg_per_rad_s", or_null(margins.phase_slope_deg_per_rad_s)},
          {"ms", margins.ms},
          {"mt", margins.mt},
          {"ms_at_rad_s", margins.ms_at_rad_s},
          {"mt_at_rad_s", margins.mt_at_rad_s},
          {"gain_margin_db", or_null(margins.gain_margin_db)},
          {"is_closed_loop_stable", margins.is_closed_loop_stable},
          {"gain_crossovers_rad_s", margins.gain_crossovers_rad_s},
          {"phase_crossovers_rad_s", margins.phase_crossovers_rad_s}};
}

OrderedJson json_of(std::span<const control::BodePoint> points) {
  OrderedJson out = {{"omega_rad_s", OrderedJson::array()},
                     {"magnitude_db", OrderedJson::array()},
                     {"phase_deg", OrderedJson::array()}};
  for (const control::BodePoint& point : points) {
    out["omega_rad_s"].push_back(point.omega_rad_s);
    out["magnitude_db"].push_back(point.magnitude_db);
    out["phase_deg"].push_back(point.phase_deg);
  }
  return out;
}

OrderedJson json_of(const control::TunedController& tuned) {
  return {{"name", tuned.name},
          {"crossover_rad_s", tuned.spec.gain_crossover_rad_s},
          {"phase_margin_deg", tuned.spec.phase_margin_deg},
          {"kp", tuned.controller.kp},
          {"kd", tuned.controller.kd},
          {"mu", tuned.controller.mu},
          {"achieved", json_of(tuned.achieved)},
          {"sampled", json_of(tuned.sampled)}};
}

OrderedJson json_of(const control::TuningResult& result) {
  OrderedJson out = {{"feasible", result.is_feasible}};
  if (result.tuned) {
    out.update(json_of(result.tuned->controller));
    const std::string remark = control::remark_on(result.tuned->controller, result.tuned->spec.gain_crossover_rad_s);
    out["warnings"] = OrderedJson::array();
    if (!remark.empty()) out["warnings"].push_back(remark);
    out["achieved"] = json_of(result.tuned->achieved);
    out["sampled"] = json_of(result.tuned->sampled);
  } else {
    out["reason"] = result.reason;
    const auto& offered = result.nearest.empty() ? result.relaxed : result.nearest;
    out["nearest"] = offered.empty() ? OrderedJson{} : json_of(offered.front());
    out["refused"] = result.refused ? json_of(*result.refused) : OrderedJson{};
  }
  out["theta_deg"] = result.theta_deg;
  out["phase_fall"] = result.phase_fall;
  out["nearest_all"] = OrderedJson::array();
  for (const auto& tuned : result.nearest) out["nearest_all"].push_back(json_of(tuned));
  out["relaxed"] = OrderedJson::array();
  for (const auto& tuned : result.relaxed) out["relaxed"].push_back(json_of(tuned));
  return out;
}

OrderedJson json_of(const control::EstimatorModel& model) {
  if (!model.is_met) return {{"refused", model.reason}, {"fit_error", model.fit_error}};
  OrderedJson out = {{"model_gain_m_s", OrderedJson::array()}, {"model_time_constant_s", OrderedJson::array()}};
  for (const float gain_m_s : model.sections.gain_m_s) out["model_gain_m_s"].push_back(as_written(gain_m_s));
  for (const float time_s : model.sections.time_constant_s) out["model_time_constant_s"].push_back(as_written(time_s));
  out["fit_error"] = model.fit_error;
  return out;
}

OrderedJson poles_json(const control::FractionalModel& model) {
  OrderedJson out = OrderedJson::array();
  if (const auto pole = control::log_pole(model)) {
    out.push_back(complex_json(std::exp(*pole)));
    out.push_back(complex_json(std::conj(std::exp(*pole))));
  } else if (model.b1 > 0 && model.alpha == 2 && model.beta == 1) {
    const double sum = model.b2 / model.b1, root = std::sqrt(std::max(0.0, sum * sum - 4 * model.b3 / model.b1));
    out.push_back(complex_json(-2 * model.b3 / model.b1 / (sum + root)));
    out.push_back(complex_json(-(sum + root) / 2));
  } else if (model.b1 == 0 && model.beta == 1) {
    out.push_back(complex_json(-model.b3 / model.b2));
  }
  return out;
}

}  // namespace server::analysis
