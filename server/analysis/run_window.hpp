// Which part of a run is looked at.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

namespace server::analysis {

// Seconds of robot time since the first sample of the span.
struct RunWindow {
  std::optional<std::uint32_t> span;  // none: the run's only one
  double from_s = 0;
  double to_s = std::numeric_limits<double>::infinity();
  bool with_velocity = false;  // the robot's own estimate of it, which is no second measurement
  bool cuts_at_gaps = false;   // the longest part without a gap that begins at rest, and a warning; else a refusal
};

}  // namespace server::analysis
