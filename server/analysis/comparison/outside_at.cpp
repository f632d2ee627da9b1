// A binary search, and a straight line.
#include "server/analysis/comparison/outside_at.hpp"

#include <algorithm>
#include <cmath>

namespace server::analysis {
namespace {

constexpr std::uint64_t kLongestOutside_us = 110'000;

}  // namespace

std::optional<PositionWithSd> outside_at(const storage::StoredReference& reference, std::uint64_t robot_time_us) {
  const storage::OutsidePositions& outside = reference.positions;
  const auto at = std::ranges::lower_bound(outside.robot_time_us, robot_time_us);
  if (at == outside.robot_time_us.end()) return std::nullopt;
  const auto after = static_cast<std::size_t>(at - outside.robot_time_us.begin());
  const std::size_t before = *at == robot_time_us || after == 0 ? after : after - 1;
  const std::uint64_t begin_us = outside.robot_time_us[before], step_us = *at - begin_us;
  if (robot_time_us < begin_us || step_us > kLongestOutside_us) return std::nullopt;
  const double share = step_us == 0 ? 0 : static_cast<double>(robot_time_us - begin_us) / static_cast<double>(step_us);
  const double sd_m = std::lerp(outside.position_sd_m[before], outside.position_sd_m[after], share);
  return PositionWithSd{std::lerp(outside.position_m[before], outside.position_m[after], share),
                        std::hypot(sd_m, reference.reference.zero_sd_m.value_or(0))};
}

}  // namespace server::analysis
