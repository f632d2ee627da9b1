// `rheonaut step`: velocity and position after a step of duty, or under any sampled duty.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/cli/design/control_files.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {

struct Step {
  PlantChoice plant;
  double duty = 0.3;
  std::vector<double> times_s;    // or, if empty,
  std::optional<double> every_s;  // equally spaced up to until_s, or log-spaced up to it
  double until_s = 60;
  std::optional<std::string> duty_csv;  // columns t_s, duty: in place of the step and the times
  OutputForm form;
};

void add_options(CLI::App& command, Step& options);
int run(const Step& options, std::ostream& out);

}  // namespace server::cli
