// Says in a sentence when a discrete controller is no longer the one that was designed.
//
// An error of 3 % moves the crossover by about as much, one of 2 degrees the phase margin: what a designer would still
// accept, about the tolerance of a motor's gain. Beyond that the margins are those of another controller.
// Errors: none thrown.
#pragma once

#include <string>

#include "control/discretisation/discretise.hpp"

namespace control {

inline constexpr double kAcceptableRelative = 0.03, kAcceptableDeg = 2;  // below the loop's bandwidth

std::string accuracy_doubt(const Discretisation& made);  // with the numbers and what to do; empty: none

}  // namespace control
