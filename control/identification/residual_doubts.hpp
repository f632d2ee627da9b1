// Warnings in words from the residuals of a fit: a model that does not describe the run, outliers, a bias, colour.
//
// Doubtful is: a fit below 50 %; a residual beyond 6 robust sd, 1.4826 times the median size; a mean beyond 4 of its
// own sigmas, by the number of independent samples; a Ljung-Box p below 0.01 in any channel; and where that is not,
// means over 2 s or more that scatter as those of white noise do not, (8) of fit_statistics.hpp. Residuals of the size
// of rounding are ignored. Errors: none thrown.
#pragma once

#include <string>
#include <vector>

#include "control/search/output_error_search.hpp"

namespace control {

std::vector<std::string> residual_doubts(const OutputErrorSearch& search, const Recording& recording,
                                         const IdentificationOptions& options, const Fit& fit);

// 100 (1 - |residual|/|measured - mean|) of the values that count in the search; infinite for a recording without
// residuals. Where the residuals are weighed by the sds of positions, so are the measured values and their mean.
double fit_percent(const OutputErrorSearch& search, const std::vector<double>& residual,
                   const std::vector<double>& measured, const std::vector<double>& sd_m = {});

}  // namespace control
