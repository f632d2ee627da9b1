// The table of a controller's results with other plants than it was tuned for, as text.
#pragma once

#include <ostream>

#include "control/tuning/robustness.hpp"

namespace server::cli {

void write_robustness(std::ostream& out, const control::RobustnessTable& table);

}  // namespace server::cli
