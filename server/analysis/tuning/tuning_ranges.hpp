// Ranges of a tuning's specification, for rooms that do not use control.
#pragma once

#include "control/tuning/tuning_ranges.hpp"

namespace server::analysis {

using control::kHighestCrossover_rad_s;
using control::kHighestMu;
using control::kLargestMarginDeg;
using control::kLongestPeriod_s;
using control::kLowestCrossover_rad_s;
using control::kLowestMu;
using control::kSmallestMarginDeg;

}  // namespace server::analysis
