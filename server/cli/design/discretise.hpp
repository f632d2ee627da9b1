// `rheonaut discretise`: the controller as coefficients that a robot can run.
#pragma once

#include <optional>

#include "control/discretisation/controller_code.hpp"
#include "control/discretisation/discretise.hpp"
#include "server/analysis/tuning/sampling.hpp"
#include "server/cli/design/control_files.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {

using analysis::discretised;
using analysis::Sampling;  // shared by the tools that simulate a controller

void add_options(CLI::App& command, Sampling& sampling);

struct Discretise {
  ControllerChoice controller;
  Sampling sampling;
  std::optional<control::CodeLanguage> code;
  OutputForm form;
};

void add_options(CLI::App& command, Discretise& options);
int run(const Discretise& options, std::ostream& out);

}  // namespace server::cli
