// `rheonaut estimator`: a plant as the model that the robot's estimator uses.
#pragma once

#include "server/cli/design/control_files.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {

struct EstimatorQuestion {
  PlantChoice plant;
  OutputForm form;
};

void add_options(CLI::App& command, EstimatorQuestion& question);

// 0, or kInfeasible when the robot's sections cannot follow the plant: then the answer has no parameters.
int run(const EstimatorQuestion& question, std::ostream& out);

}  // namespace server::cli
