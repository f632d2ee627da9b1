// The Grünwald-Letnikov scheme for the velocity, only as a reference for other methods: it is first order in dt_s.
//
//   y[k] = (kp u[k] - Σ_{j=1..k} c_j y[k-j])/(c_0 + b3),  c_j = b1 h^-α w_j^(α) + b2 h^-β w_j^(β)    (1)
//   w_0 = 1, w_j = w_{j-1} (1 - (order + 1)/j)                                                     (2)
//
// Accuracy: of (29) at 10 ms, 4 % at 0.1 s, 2e-4 at 1 s. Cost grows with the square of the number of samples unless
// terms is limited; then the steady velocity is wrong for ever.
// Errors: throws std::invalid_argument quoting the bad value, for a model with a dead time, and for more than 200 000
// samples.
#pragma once

#include <span>
#include <vector>

#include "control/models/plant_models.hpp"

namespace control {

// Velocity for duty[0..n-1]. terms: how many c_j are kept, 0 for all.
std::vector<double> grunwald_letnikov_velocity(const FractionalModel& model, double dt_s, std::span<const double> duty,
                                               std::size_t terms = 0);

}  // namespace control
