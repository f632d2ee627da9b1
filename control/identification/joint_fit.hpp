// Turns the result of a joint search into a fit of all runs and one of each.
//
//   covariance = (JᵀJ)⁻¹, J of all runs over the common and all further parameters, by the sd of each run    (1)
//   fit = 100 (1 - √(Σ n_i / Σ n_i/ρ_i²)),  ρ_i = |y - model|/|y - mean y| of run i's first channel          (2)
//   p = 1 - (1 - min p_i)^runs                                            (3)   Šidák: the least of several
//   F = (Σ explained_i/(p (runs - 1)))/((Σ rest_i)/freedom)              (4)   about 1 where one model suits all runs
// In (2) each run is weighed by its own residuals. (4) is a score test: explained_i is what the slopes of run i, with
// parameters of its own, could still take off its residuals. A dead time of accelerations is the mean of what the runs
// say. Errors: none thrown.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "control/search/joint_search.hpp"

namespace control {

struct JointFit {
  Fit all;
  std::vector<Fit> runs;
};

JointFit joint_summary(JointSearch& search, std::span<const Recording> recordings, Cost cost, Structure structure,
                       const JointResult& found);

// That the runs do not agree on one model, by (4); none: they do.
std::optional<ScoreEvidence> disagreement(JointSearch& search, Structure structure, const JointResult& found);
std::string disagreement_in_words(const ScoreEvidence& evidence);

}  // namespace control
