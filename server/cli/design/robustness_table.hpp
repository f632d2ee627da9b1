// The table of a controller in worlds it was not tuned for, as text.
#pragma once

#include <ostream>

#include "control/tuning/robustness.hpp"

namespace server::cli {

void write_robustness(std::ostream& out, const control::RobustnessTable& table);

}  // namespace server::cli
