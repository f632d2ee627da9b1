// The progress of an identification, in words and as a share of the whole.
//
//   share = 1 - (1 - 0.8 s) 0.2^n,  s: share of the search that goes on, n: searches before it at most          (1)
//
// A search may be followed by others of the same record: with a dead time that nobody named, and without the duties of
// a dead zone. Only its result shows whether, so each has most of what is left.
#pragma once

#include <string>

#include "control/search/fit.hpp"

namespace server::analysis {

// "for a dead time, fractional: start 1 of 5, iteration 12"
std::string in_words(const control::Progress& progress);

class SearchShare {
 public:
  explicit SearchShare(bool has_one_structure) : structures_{has_one_structure ? 1 : 3} {}

  // (1), or the largest until then: other explanations of a fit are searched between its searches.
  double at(const control::Progress& progress);

 private:
  int structures_;
  double largest_ = 0;
};

}  // namespace server::analysis
