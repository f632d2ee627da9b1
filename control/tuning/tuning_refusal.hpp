// Why a specification has no solution, in one sentence with its numbers: the conditions (5) of tune.hpp.
//
// Errors: none; the arguments have been checked.
#pragma once

#include <string>

#include "control/tuning/design.hpp"
#include "control/tuning/tuning_equations.hpp"

namespace control {

// For θ and R of (2), where (5), or the range of θ of a fixed mu, does not hold.
std::string why_no_solution(const TuningSpec& spec, double theta_deg, double phase_fall);

// Where (5) holds, and controller_for has none for this mu.
std::string why_no_controller(const TuningSpec& spec, const TuningDemand& demand, double mu);

}  // namespace control
