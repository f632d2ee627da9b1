// Names values of a recording that look as if they were in another unit.
//
// A small swimming robot moves at less than 5 m/s and 20 m, its duty is from -1 to 1, and it is sampled more often than
// once a second. What lies beyond is probably a position in mm, a duty in percent, a time in ms. The fit is made all
// the same. Errors: none thrown.
#pragma once

#include <string>
#include <vector>

#include "control/search/fit.hpp"

namespace control {

std::vector<std::string> unit_doubts(const Recording& recording);  // what, which value, what to do

}  // namespace control
