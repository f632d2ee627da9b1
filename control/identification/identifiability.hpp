// Warnings in words: what a fit does not determine, and what to do about it.
//
// Doubtful is: one sigma of b1 or b2 above half of it, of kp above a tenth, of alpha or beta above 0.1; a correlation
// above 0.99; a parameter at its bound; starts that disagree; a duty that never changes; a search that did not end.
// A better experiment is named only if it would halve one of the doubtful sigmas, by a model that describes the run.
// Errors: none thrown.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "control/search/fit.hpp"

namespace control {

inline constexpr double kPoorFitPercent = 50;

// How the search ended, and whether a limit of its own decided the result.
std::vector<std::string> search_doubts(const Fit& fit, const IdentificationOptions& options);

// Of several runs that were fitted together: the fit of the longest, with the sigmas of all.
std::vector<std::string> identifiability_warnings(const Recording& recording, const Fit& fit,
                                                  const IdentificationOptions& options, std::size_t runs = 1);

// By their place in kParameterNames.
bool is_order(std::size_t parameter);
std::array<double, kParameters> parameters_of(const FractionalModel& model);
std::vector<std::size_t> undetermined_parameters(const Fit& fit);
std::vector<std::size_t> parameters_at_bound(const Fit& fit);
bool lies_at_bound(std::size_t parameter, double value);  // an order that was fitted: its sigma means little there

// A fit that is poor in percent describes the run nevertheless where only the accelerometer's white noise is left.
bool describes_run(const Fit& fit);
// Less than 1 %: of a run with a constant duty, or one that it does not describe, whose noise may hide a small motion.
bool explains_nothing(const Recording& recording, const Fit& fit);

std::string structure_name(Structure structure);
std::string end_words(SearchEnd end);  // "reached its time limit"

}  // namespace control
