// Seconds as whole microseconds, with room for those that never end.
#pragma once

#include <cmath>
#include <cstdint>

namespace sim_robot {

constexpr std::uint64_t kNeverUs = UINT64_MAX;

// Of seconds that are not negative; what is as good as for ever is kNeverUs, so that every sum of two others fits, also
// as nanoseconds of a clock of the host.
inline std::uint64_t microseconds(double seconds) {
  constexpr double kMostSeconds = 4e9;
  if (!(seconds < kMostSeconds)) return kNeverUs;
  return static_cast<std::uint64_t>(std::llround(1e6 * seconds));
}

// When what lasts so long from then on is over.
inline std::uint64_t end_us(std::uint64_t from_us, double for_s) {
  const std::uint64_t for_us = microseconds(for_s);
  return for_us == kNeverUs ? kNeverUs : from_us + for_us;
}

}  // namespace sim_robot
