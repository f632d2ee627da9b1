// `rheonaut tune`: a fractional PD controller for a crossover and a phase margin, or a map of those that have one.
#pragma once

#include "control/tuning/tune.hpp"
#include "control/tuning/tuning_map.hpp"
#include "server/cli/design/control_files.hpp"
#include "server/cli/terminal/output.hpp"

namespace CLI {
class Validator;
}

namespace server::cli {

inline constexpr int kInfeasible = 3;  // exit status

struct Tune {
  PlantChoice plant;
  control::TuningSpec spec{5, 91, std::nullopt, false, 0.01};
  bool with_robustness = false;
  bool is_map = false;  // instead of a controller
  control::TuningMapSpec map;
  OutputForm form;
};

void add_options(CLI::App& command, Tune& options);

// Ranges of a specification, as the API takes them, for CLI::Option::check.
CLI::Validator crossovers();  // rad/s
CLI::Validator margins();     // degrees
CLI::Validator mus();

// 0, or kInfeasible when nothing meets the specification. A map is always 0.
int run(const Tune& options, std::ostream& out);

}  // namespace server::cli
