// The answer of an identification, for the command line and for a job: what was found, from which channels, with the
// doubts that a position from outside adds.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "control/discretisation/estimator_model.hpp"
#include "control/identification/identify.hpp"
#include "server/analysis/control_json.hpp"
#include "server/analysis/run_recording.hpp"

namespace server::analysis {

std::vector<std::string> channels_of(const control::Recording& recording);

// identify() on a piece of a run, and the warnings of both.
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

}  // namespace server::analysis
