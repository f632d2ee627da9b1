// Refuses recordings and options of an identification that cannot be used.
//
// Errors: std::invalid_argument quoting the bad value.
#pragma once

#include "control/search/fit.hpp"

namespace control {

void check_recording(const Recording& recording);
void check_options(const IdentificationOptions& options, const Recording& recording);

}  // namespace control
