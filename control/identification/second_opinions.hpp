// Tries other explanations of a run than the fit, and reports in words which of them fit better.
//
//   an inverted sign: if the fit is poor, and inverting leaves less than half of the residual
//   an offset, if it was not to be fitted: AIC lower by more than 10
//   a run that begins in motion: v0 e^{-t/T} added to the model by one linear step, for the best of some T        (1)
// (1) is the change of least squares with all parameters free, so a part of v0 that they can imitate does not count,
// and neither does a v0 up to kSlowestMotionM_S;
// or first samples, 20 or one second of them, that fit three times worse than the rest.
//   a duty that stands one row too early or too late: AIC lower by more than 10, where one linear step asks for it
// Each costs one search at most, within the time that is left; none is tried when the search was cancelled.
// Errors: none thrown.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "control/search/fit.hpp"
#include "control/search/output_error_search.hpp"

namespace control {

std::vector<std::string> second_opinions(OutputErrorSearch& search, const Recording& recording,
                                         const IdentificationOptions& options, const Fit& fit);

// Of an acceleration: how much of the age of its readings may be the plant's dead time, which looks the same, and to
// which of the two it was attributed.
std::vector<std::string> lag_doubts(const Recording& recording, const IdentificationOptions& options, const Fit& fit);

// Whether a dead time that nobody named is to be searched for: readings of an acceleration come later than the lag that
// (2) of sensor_prior.hpp allows, or residuals of another record follow the duty (score_doubts.hpp), for which neither
// amplitude, a structure that was forced, nor a clock that is fitted is the likelier reason; whether what it found is
// taken: for an acceleration by its residuals, for other records by AIC and by what it leaves of the evidence of the
// input; and what is said of it then.
bool asks_for_dead_time(const Recording& recording, const IdentificationOptions& options, const Fit& fit,
                        const std::optional<ScoreEvidence>& amplitude, const std::optional<ScoreEvidence>& input);
struct DeadTimeTrial {
  const Fit& fit;
  const std::optional<ScoreEvidence>& input;  // of several runs that of the clearest
};
bool is_explained_better(const DeadTimeTrial& with_dead_time, const DeadTimeTrial& without, bool by_acceleration);
std::string dead_time_in_words(const Fit& fit, double dt_s);

}  // namespace control
