// `rheonaut predict`: predicts a closed-loop experiment, and compares it with a recorded one.
#pragma once

#include <optional>

#include "control/responses/closed_loop.hpp"
#include "server/cli/design/control_files.hpp"
#include "server/cli/design/discretise.hpp"
#include "server/cli/design/run_choice.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {

struct Predict {
  PlantChoice plant;
  ControllerChoice controller;
  Sampling sampling;
  control::ClosedLoopExperiment experiment;  // plant, controller and duty range are filled in by run
  std::optional<double> duty_min, duty_max;  // none: those of the run's controller, or -1 and 1
  RunChoice run;  // whose first step, and disturbance, are then the experiment, with its controller unless one is named
  bool with_robustness = false;
  OutputForm form;
};

void add_options(CLI::App& command, Predict& options);
int run(const Predict& options, std::ostream& out);

}  // namespace server::cli
