// Tests whether the residuals of a fit hold what a better model would have explained: one whose parameters change with
// amplitude, so that no linear model holds for all of the run, or another linear one.
//
//   r = J a + E c + noise                                              (1)   r: residuals of the fit
//   J: slopes of the output by all parameters, and the columns below    what another linear model could explain
//   E: the same slopes by the model's parameters for the duties u|u| and v|v| in place of u            (2)
//   share = (|r - J a|² - |r - J a - E c|²)/|r - J a|²                 (3)   least squares, each over its own unknowns
//   F = share/(1 - share) · (n - rank J - rank E)/rank E               (4)   about 1 where nothing changes
//
// A parameter q that is q0 + q1 |u| adds q1 ∂model/∂q for the duty u|u| to the output, and a drag that is not in
// proportion to the speed adds the model's response to v|v|, in lowest order: a score test, without a second search.
// u|u| says nothing if the duty has one magnitude only, v|v| nothing if the speed hardly changes.
// Not amplitude: what J has besides (an output of the model that comes later, offset, drift and motion before the run
// in position and velocity; readings of another age in each second, if the sensor's clock was not found). Doubtful is F
// above 60 with a share of at least 10 %.
// Another linear model: J are the slopes by the parameters that were fitted with what is no amplitude in any case, and
// E the model's outputs 1, 2, 3, 5, … ticks later, up to a quarter of the record: a dead time, or a path with another
// response. F is divided by n/n_effective of what is left, and the widening counts what chance does not explain.
// Doubtful is F above 5 with a share of at least 1 %; fewer than 10 values for a column of E say nothing. Figures of
// both over fluids and seeds are in docs/control.md.
// Errors: none thrown.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "control/search/fit.hpp"
#include "control/search/output_error_search.hpp"

namespace control {

// None: the residuals are rounding, or there is nothing to compare.
std::optional<ScoreEvidence> amplitude_evidence(OutputErrorSearch& search, const Recording& recording, const Fit& fit,
                                                const SearchPoint& point);

std::optional<ScoreEvidence> input_evidence(OutputErrorSearch& search, const Recording& recording, const Fit& fit,
                                            const SearchPoint& point);

bool changes_with_amplitude(const std::optional<ScoreEvidence>& evidence);
bool follows_input(const std::optional<ScoreEvidence>& evidence);
bool may_lack_dead_time(const std::optional<ScoreEvidence>& input);  // F above 3: worth a search
// A dead time that was found is the reason for the evidence `before` where F is at most 3 with it, or less than a
// quarter: a fluid that is not linear follows the duty nearly as much with a dead time as without.
bool is_settled_by_dead_time(const std::optional<ScoreEvidence>& left, const std::optional<ScoreEvidence>& before);

// order_is_forced: the structure was given, and it is not the fractional one; structure_option: how, or empty.
std::vector<std::string> amplitude_doubts(const std::optional<ScoreEvidence>& evidence, const Recording& recording,
                                          bool order_is_forced, const std::string& structure_option = {});

// Sentences about evidence that amplitude does not explain.
std::vector<std::string> input_doubts(const std::optional<ScoreEvidence>& evidence,
                                      const std::optional<ScoreEvidence>& amplitude,
                                      const IdentificationOptions& options);

}  // namespace control
