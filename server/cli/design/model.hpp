// `rheonaut model`: the motion models of the paper, the hydrodynamics behind one of them, and the motor's fit.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "control/models/plant_models.hpp"
#include "server/cli/design/control_files.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {

enum class Preset : std::uint8_t { non_newtonian, newtonian, hydrodynamic };
const char* text(Preset value);

struct Model {
  control::HydrodynamicParameters parameters;
  std::optional<Preset> preset;          // prints this model as a model file
  std::optional<std::string> motor_csv;  // columns t_s, duty, rate_rad_s: fits the motor and uses it
  OutputForm form;
};

void add_options(CLI::App& command, Model& options);
int run(const Model& options, std::ostream& out);

}  // namespace server::cli
