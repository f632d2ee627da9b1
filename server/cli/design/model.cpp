// `rheonaut model`.
#include "server/cli/design/model.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>

#include "control/search/motor_fit.hpp"
#include "server/analysis/control_json.hpp"
#include "server/cli/terminal/options.hpp"

namespace server::cli {
namespace {

constexpr double kSpacingTolerance = 0.01;
constexpr const char* kHydrodynamics = "Hydrodynamics, Table 1";

void add_parameters(CLI::App& command, control::HydrodynamicParameters& p) {
  const auto add = [&command](const char* flag, double& value, const char* meaning) {
    command.add_option(flag, value, fmt::format("{} (default: {})", meaning, value))
        ->check(finite())
        ->group(kHydrodynamics);
  };
  add("--thrust-coefficient", p.thrust_coefficient, "Ct");
  add("--drag-coefficient", p.drag_coefficient, "Cd");
  add("--propeller-diameter-m", p.propeller_diameter_m, "d");
  add("--propeller-radius-m", p.propeller_radius_m, "r");
  add("--blade-area-m2", p.blade_area_m2, "A");
  add("--fluid-density-kg-m3", p.fluid_density_kg_m3, "rho");
  add("--frontal-area-m2", p.frontal_area_m2, "Af");
  add("--added-mass-coefficient", p.added_mass_coefficient, "beta of the added mass");
  add("--flow-velocity-m-s", p.flow_velocity_m_s, "V");
  add("--mass-kg", p.mass_kg, "m");
  add("--operating-velocity-m-s", p.operating_velocity_m_s, "u0");
  add("--motor-gain-rad-s", p.motor.gain_rad_s, "km, per duty");
  add("--motor-time-constant-s", p.motor.time_constant_s, "Tm");
  add("--numerator", p.numerator, "k, empirical");
}

control::MotorFit fit_motor(const std::string& file) {
  const analysis::CsvColumns columns = read_csv(file, {"t_s", "duty", "rate_rad_s"});
  const auto& times_s = columns.at("t_s");
  if (times_s.size() < 3)
    throw std::runtime_error{fmt::format("{}: has {} rows; at least 3 are needed", file, times_s.size())};
  const double dt_s = (times_s.back() - times_s.front()) / static_cast<double>(times_s.size() - 1);
  for (std::size_t i = 1; i < times_s.size(); ++i) {
    const double step_s = times_s[i] - times_s[i - 1];
    if (!(dt_s > 0 && std::abs(step_s - dt_s) <= kSpacingTolerance * dt_s)) {
      throw std::runtime_error{fmt::format("{}: the times are not equally spaced: {} s after t_s = {}, {} s on average",
                                           file, step_s, times_s[i - 1], dt_s)};
    }
  }
  return control::fit_motor(dt_s, columns.at("duty"), columns.at("rate_rad_s"));
}

analysis::OrderedJson described(const control::FractionalModel& model) {
  analysis::OrderedJson out = analysis::json_of(model);
  out["dc_gain_m_s"] = model.kp / model.b3;
  out["poles_rad_s"] = analysis::poles_json(model);
  return out;
}

std::string poles_text(const control::FractionalModel& model) {
  std::string text;
  for (const auto& pole : analysis::poles_json(model)) {
    const double imaginary = pole["imaginary"];
    if (imaginary < 0) continue;
    text += text.empty() ? "" : ", ";
    text += cell(pole["real"].get<double>()) + (imaginary > 0 ? fmt::format(" +- {:.6g}j", imaginary) : "");
  }
  return text.empty() ? "none on the first sheet" : text;
}

void write_models(std::ostream& out, const control::HydrodynamicModel& derived) {
  Table table{{"model", "kp", "b1", "b2", "b3", "alpha", "beta", "DC gain (m/s)", "<poles (1/s)"}};
  const auto add = [&table](const char* name, const control::FractionalModel& m) {
    table.row({name, cell(m.kp), cell(m.b1), cell(m.b2), cell(m.b3), cell(m.alpha), cell(m.beta), cell(m.kp / m.b3),
               poles_text(m)});
  };
  add("non_newtonian (29)", control::kNonNewtonianModel);
  add("newtonian (28)", control::kNewtonianModel);
  add("hydrodynamic (18)", derived.model);
  table.write(out);
}

void write_hydrodynamics(std::ostream& out, const control::HydrodynamicModel& derived) {
  Table table{{"hydrodynamics", "value", "<unit"}};
  table.row({"mass and added mass M", cell(derived.total_mass_kg), "kg"});
  table.row({"linear drag Xu", cell(derived.linear_drag_kg_s), "kg/s"});
  table.row({"quadratic drag X|u|u", cell(derived.quadratic_drag_kg_m), "kg/m"});
  table.row({"damping D", cell(derived.damping_kg_s), "kg/s"});
  table.row({"numerator in use, empirical", cell(derived.model.kp), "m/s3"});
  table.row({"numerator by (18)", cell(derived.derived_numerator), "m/s3"});
  table.write(out);
}

void write_fit(std::ostream& out, const control::MotorFit& fit) {
  Table table{{"motor", "value", "one sigma", "<unit"}};
  table.row({"gain km", cell(fit.motor.gain_rad_s), cell(fit.gain_sigma_rad_s, 3), "rad/s"});
  table.row({"time constant Tm", cell(fit.motor.time_constant_s), cell(fit.time_constant_sigma_s, 3), "s"});
  table.write(out);
  fmt::print(out, "fit {} %, residual sd {} rad/s\n\n", fixed(fit.fit_percent, 2), cell(fit.residual_sd_rad_s, 4));
}

control::FractionalModel chosen(Preset preset, const control::HydrodynamicModel& derived) {
  switch (preset) {
    case Preset::non_newtonian: return control::kNonNewtonianModel;
    case Preset::newtonian: return control::kNewtonianModel;
    case Preset::hydrodynamic: return derived.model;
  }
  throw std::logic_error{"no such preset"};
}

}  // namespace

const char* text(Preset value) {
  switch (value) {
    case Preset::non_newtonian: return "non_newtonian";
    case Preset::newtonian: return "newtonian";
    case Preset::hydrodynamic: return "hydrodynamic";
  }
  return "unknown";
}

void add_options(CLI::App& command, Model& options) {
  add_word(command, "--preset", options.preset,
           std::array{Preset::non_newtonian, Preset::newtonian, Preset::hydrodynamic},
           "Print this model as a model file: non_newtonian, newtonian, hydrodynamic");
  auto* motor =
      command.add_option("--motor-csv", options.motor_csv, "Fit the motor to a CSV with columns t_s, duty, rate_rad_s");
  motor->check(named());
  add_parameters(command, options.parameters);
  motor->excludes("--motor-gain-rad-s")->excludes("--motor-time-constant-s");
  // What would go unused: the printed presets of the paper do not depend on it.
  command.parse_complete_callback([&command, &options] {
    if (!options.preset || *options.preset == Preset::hydrodynamic) return;
    for (const CLI::Option* option : command.get_options()) {
      if (option->count() == 0 || (option->get_group() != kHydrodynamics && option->get_name() != "--motor-csv"))
        continue;
      throw CLI::ExcludesError{option->get_name(),
                               fmt::format("--preset {}, which it does not change", text(*options.preset))};
    }
  });
  add_json_flag(command, options.form);
  command.footer("Example: rheonaut model --preset hydrodynamic --mass-kg 0.12");
}

int run(const Model& options, std::ostream& out) {
  control::HydrodynamicParameters parameters = options.parameters;
  std::optional<control::MotorFit> motor;
  if (options.motor_csv) {
    motor = fit_motor(*options.motor_csv);
    parameters.motor = motor->motor;
  }
  const control::HydrodynamicModel derived = control::hydrodynamic_model(parameters);
  if (options.preset) {
    write_json(out, analysis::json_of(chosen(*options.preset, derived)));
    return 0;
  }
  if (options.form.is_json) {
    analysis::OrderedJson hydrodynamic = analysis::json_of(derived);
    hydrodynamic["model"] = described(derived.model);
    hydrodynamic["parameters"] = analysis::json_of(parameters);
    write_json(out, {{"non_newtonian", described(control::kNonNewtonianModel)},
                     {"newtonian", described(control::kNewtonianModel)},
                     {"hydrodynamic", hydrodynamic},
                     {"motor_fit", motor ? analysis::json_of(*motor) : analysis::OrderedJson(nullptr)}});
    return 0;
  }
  if (motor) write_fit(out, *motor);
  write_models(out, derived);
  out << '\n';
  write_hydrodynamics(out, derived);
  return 0;
}

}  // namespace server::cli
