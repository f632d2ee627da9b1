// The answer of an identification, for the command line and for a job: what was found, from which channels, with the
// doubts that a position from outside adds.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "control/discretisation/estimator_model.hpp"
#include "control/identification/identify.hpp"
#include "server/analysis/control_json.hpp"
#include "server/analysis/run_recording.hpp"

namespace server::analysis {

std::vector<std::string> channels_of(const control::Recording& recording);

// A search that has reached its time limit: what it found until then is no model.
inline bool is_out_of_time(const control::Fit& fit) { return fit.end == control::SearchEnd::time_limit; }

// identify() on a piece of a run, and the warnings of both. Out of time it has nothing but that.
control::Identification identify_run(const RunRecording& recorded, const control::IdentificationOptions& options);

// Of positions from outside, by the sds that their importer gave them; none where there are none.
struct ChiSquare {
  double value = 0, degrees_of_freedom = 0;
};
std::optional<ChiSquare> chi_square_of(const RunRecording& recorded, const control::Fit& fit);

// For the robot's estimator. None of a search that found no finite model.
std::optional<control::EstimatorModel> estimator_of(const control::Fit& fit);

// Readable by the command-line tools as a model.
OrderedJson answer_json(const RunRecording& recorded, const control::Identification& found, bool with_residuals);

// One of several runs that are fitted together.
struct RunOfMany {
  storage::RunId run = 0;
  RunRecording recorded;
};

// identify_together() on them, and the warnings of each run, in the run. Throws std::invalid_argument, which names the
// run whose recording cannot be used.
control::Identification identify_runs(std::span<const RunOfMany> runs, const control::IdentificationOptions& options);

// As above, with `runs`: of each its channels, offset, sensor, quality, warnings, and residuals if they are asked for.
OrderedJson answer_json(std::span<const RunOfMany> runs, const control::Identification& found, bool with_residuals);

// In the order of the runs, each followed by its number.
std::vector<std::string> warnings_of_runs(std::span<const RunOfMany> runs, const control::Identification& found);

}  // namespace server::analysis
