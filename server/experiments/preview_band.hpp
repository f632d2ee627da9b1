// How uncertain a prediction is, as far as its model's parameters are: a band around the predicted position.
//
//   sd(t)² = Σ_ij ρ_ij d_i(t) d_j(t) + d_T(t)²,  d_i = σ_i ∂x(t)/∂θ_i,  d_T of the dead time         (1)
//
// σ and ρ are those of the model's fit, the derivatives are differences of two predictions. First order: true where the
// position is nearly straight in the parameters over ±σ. Neither sensor noise nor flow is in it, and nothing of what no
// such model describes. Pure. Errors: throws std::invalid_argument quoting the bad value.
#pragma once

#include <vector>

#include "control/identification/planned_experiment.hpp"
#include "server/experiments/preview.hpp"

namespace server::experiments {

// One sd for each sample of preview_of() with the same arguments.
std::vector<double> position_sd_of(const Profile& profile, const TimeLine& line, const control::FractionalModel& plant,
                                   const control::ExpectedUncertainty& uncertainty,
                                   const control::ParallelSections& controller);

}  // namespace server::experiments
