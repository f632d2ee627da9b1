// Turns the samples of a run into what the mathematics takes: one gapless, equally spaced piece of one boot.
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "control/identify.hpp"
#include "server/analysis/run_steps.hpp"
#include "server/recording/history.hpp"
#include "server/result.hpp"

namespace server {

StepPoint step_point(const StoredSample& stored);

// Which part of a run: seconds of robot time since the first sample of the span.
struct RunWindow {
  std::optional<std::uint32_t> span;  // none: the run's only one
  double from_s = 0;
  double to_s = std::numeric_limits<double>::infinity();
  bool with_velocity = false;  // the robot's own estimate of it, which is no second measurement
};

// position_m is what was measured: without the disturbance, which the robot adds to it.
// invalid: several spans to choose from, too few samples, a gap or a value that is missing; the detail says where, how
// long, and which window would do.
Result<control::Recording> recording_of(std::span<const StoredSample> samples, const RunWindow& window);

}  // namespace server
