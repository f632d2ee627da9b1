// Says in words what a fit does not tell, and what to do about it.
//
// Doubtful is: one sigma of b1 or b2 above half of it, of kp above a tenth, of alpha or beta above 0.1; a correlation
// above 0.99; a parameter at its bound; residuals that are not white; starts that disagree; a duty that never changes.
#pragma once

#include <string>
#include <vector>

#include "control/identify.hpp"

namespace control {

std::vector<std::string> identifiability_warnings(const Recording& recording, const Fit& fit, bool fits_offset);

std::string structure_name(Structure structure);

}  // namespace control
