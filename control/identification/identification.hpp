// The result of an identification: the best model, those that it was compared with, and what is doubtful about it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "control/evidence/dead_zone.hpp"
#include "control/evidence/score_doubts.hpp"
#include "control/identification/doubts.hpp"
#include "control/search/fit.hpp"

namespace control {

// One of several recordings that were fitted together.
struct JointRun {
  Fit fit;  // the common model; offset, clock, sensor, residuals and their quality are this run's
  std::vector<std::string> warnings;
  std::optional<ScoreEvidence> amplitude, input;  // of this run; none: nothing to compare
};

struct Identification {
  Fit best;
  std::vector<Fit> compared;  // one per structure: the best, then by AIC; unfinished and untried ones last
  std::optional<ScoreEvidence> amplitude, input;  // of the best; none: nothing to compare
  std::optional<DeadZone> dead_zone;              // of the motor, where the fit is without the duties below it
  std::vector<std::string> warnings;              // in words, with numbers and what to do
  std::vector<Doubt> doubts;                      // those of them that its uses count
  std::vector<JointRun> runs;                     // of several recordings, in their order; empty: there was one
};

}  // namespace control
