// Further searches of the same records, where the first one asks for them: with a dead time that nobody named, or
// without the duties at which the motor stands still.
//
// Each has what is left of the time, and reports its progress as what it is, once before its first step. Errors: none
// thrown.
#pragma once

#include <functional>
#include <span>

#include "control/identification/identification.hpp"

namespace control {

// Options of a search for a dead time up to 0.2 s, or to a quarter of the shortest record.
IdentificationOptions with_dead_time(IdentificationOptions options, const Recording& shortest, double left_s);

using Searching = std::function<Identification(std::span<const Recording>, const IdentificationOptions&)>;

// The search's result; where it has found a dead zone, the result without the duties below, if that leaves less and
// nothing that changes with amplitude.
Identification with_own_dead_zone(std::span<const Recording> recordings, const IdentificationOptions& options,
                                  const Searching& search);

}  // namespace control
