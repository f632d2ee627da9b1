// Refuses outside positions whose unit seems wrong: they move far more than the robot's own record.
//
// Without a clock by correlation a robot may have missed much of its motion, but not all but a 30th of over 2 m: that
// looks like centimetres or millimetres. A flow carries a robot along unseen, as when it holds a position that it
// believes: so a straight line in time is taken off both motions first.
#pragma once

#include <string>
#include <vector>

#include "server/runtime/result.hpp"

namespace server::analysis {

// What to do about positions whose motion is `ratio` times that of the robot's own record.
std::string unit_advice(double ratio);

// Both motions at the same, ascending times.
Result<void> check_metres(const std::vector<double>& time_s, std::vector<double> outside_m, std::vector<double> own_m);

}  // namespace server::analysis
