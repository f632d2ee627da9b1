// A robot's controller as the library's sections.
#pragma once

#include "control/responses/sections.hpp"
#include "protocol/messages.hpp"

namespace server::analysis {

// As the robot runs it on the error: its sections act a sample later (docs/protocol.md), and `direct` is corrected so
// that the DC gain is exactly kp. Says nothing of derivative_on and the duty range.
control::ParallelSections sections_of(const protocol::Controller& controller);

}  // namespace server::analysis
