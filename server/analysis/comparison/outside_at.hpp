// The position from outside at a time of the robot's clock, between the times at which it was measured.
#pragma once

#include <cstdint>
#include <optional>

#include "server/storage/runs/outside_reference.hpp"

namespace server::analysis {

struct PositionWithSd {
  double position_m = 0;
  double sd_m = 0;  // that of the zero counted
};

// In a straight line between two positions; none where they are more than 0.11 s apart, before the first and after the
// last. The time is of the reference's span.
std::optional<PositionWithSd> outside_at(const storage::StoredReference& reference, std::uint64_t robot_time_us);

}  // namespace server::analysis
