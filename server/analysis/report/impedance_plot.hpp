// The impedance map as a section of a report: a plot over the position, and a table of detections and deliveries.
#pragma once

#include <string>

#include "server/analysis/comparison/impedance_map.hpp"

namespace server::analysis {

std::string impedance_section(const ImpedanceMap& map);

}  // namespace server::analysis
