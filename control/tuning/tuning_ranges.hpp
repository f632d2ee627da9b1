// Ranges of a tuning's specification, on the command line, of a job, and of what is offered instead: beyond them are no
// robots, and a search for what is near may take minutes.
#pragma once

namespace control {

inline constexpr double kLowestCrossover_rad_s = 1e-3, kHighestCrossover_rad_s = 1e4;
inline constexpr double kSmallestMarginDeg = 0.1, kLargestMarginDeg = 179.9;
inline constexpr double kLowestMu = 0.01, kHighestMu = 1.99;
inline constexpr double kLongestPeriod_s = 1;  // of the robot's controller

}  // namespace control
