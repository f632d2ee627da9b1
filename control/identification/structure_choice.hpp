// Which of the structures that were fitted is the best, and what the others say.
//
// Errors: none thrown.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "control/search/fit.hpp"

namespace control {

// The least AIC among those searched, first. The AIC of an unfinished one is an upper bound: so it may win, but where
// it does not it is not ranked, and stands after the finished ones.
void put_best_first(std::vector<Fit>& fits);

// Of fits in that order: those that were not tried, or not to the end.
std::vector<std::string> untried_structures(const std::vector<Fit>& fits);

// That fractional orders are not called for by this number of runs; only finished searches can say so.
void add_verdict(const std::vector<Fit>& fits, std::size_t runs, std::vector<std::string>& warnings);

// That whole orders are hardly worse: a sigma is that of a linearised model at the optimum, and too small where the
// cost is flat away from it. A model whose AIC is higher by 10 has no support (Burnham and Anderson 2002, 2.6).
void add_rival(const std::vector<Fit>& fits, std::vector<std::string>& warnings);

}  // namespace control
