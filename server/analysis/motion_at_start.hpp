// Detects that a recording begins in motion; identification assumes that the robot rests before the first sample.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "control/identification/identify.hpp"

namespace server::analysis {

// A warning for the reader of the fit: the speed of the first samples, and what to do. None when the recording may well
// begin at rest, also under a duty that sets in with its first sample, or below kSlowestMotionM_S. An acceleration
// alone does not show it: there the velocity that the robot recorded is looked at, which is an estimate, but good
// enough for a warning.
std::optional<std::string> motion_at_start(const control::Recording& recording,
                                           std::span<const double> recorded_velocity_m_s = {});

}  // namespace server::analysis
