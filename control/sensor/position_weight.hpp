// How positions that are not all as exact weigh in a fit.
//
//   weight of y_i = s/σ_i,  1/s² = mean of 1/σ_i²                                           (1)   its square has mean 1
// So χ² = n · (mean square of the weighed residuals)/s².
#pragma once

#include <span>

namespace control {

double sd_of_mean_weight(std::span<const double> sd_m);  // s of (1)

}  // namespace control
