// `rheonaut bode`: crossover, margins and frequency response of the open loop.
#pragma once

#include <optional>

#include "control/responses/margins.hpp"
#include "server/cli/design/control_files.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {

struct Bode {
  PlantChoice plant;
  ControllerChoice controller;
  bool is_velocity_loop = false;
  double period_s = 0.01;                      // of the robot that runs the controller
  std::optional<double> from_rad_s, to_rad_s;  // of the response; none: 0.1 to 1000
  std::optional<int> points;
  OutputForm form;
};

void add_options(CLI::App& command, Bode& options);
int run(const Bode& options, std::ostream& out);

}  // namespace server::cli
