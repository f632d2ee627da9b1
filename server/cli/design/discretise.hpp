// `rheonaut discretise`: the controller as coefficients that a robot can run.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "control/discretisation/discretise.hpp"
#include "server/cli/design/control_files.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {

// How a controller becomes discrete; shared by the tools that simulate one.
struct Sampling {
  double period_s = 0.01;
  int order = 5;
  std::optional<control::DiscretisationMethod> method;  // neither method nor a: several are tried
  std::optional<double> a;
  double bandwidth_rad_s = 30;
};

void add_options(CLI::App& command, Sampling& sampling);

// The chosen one, why it was chosen, and what was tried.
control::DiscretisationChoice discretised(const control::FopdController& controller, const Sampling& sampling);

struct Discretise {
  ControllerChoice controller;
  Sampling sampling;
  OutputForm form;
};

void add_options(CLI::App& command, Discretise& options);
int run(const Discretise& options, std::ostream& out);

}  // namespace server::cli
