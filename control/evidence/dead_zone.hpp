// Tests whether the motor stood still at small duties, of one run or of several of one robot.
//
//   r_i = C_i a + D_i b_i - c m_i(z) + noise_i,  m_i(z): the output of run i for u 1(|u| < z)           (1)   c about 1
//
// r_i: residuals of the fit, in units of their sd; C_i: slopes by the model's parameters and its dead time, which are
// common; D_i: by what belongs to run i, and its disturbances (score_columns.hpp). The duties below the zone z made no
// output: m is missing, by the whole of it. D_i is projected off run by run, then C off all of them.
// Candidates for z lie between the duties of all records: between neighbours of their magnitudes, if these are few,
// else on a grid. The one that explains most is named where it explains 10 % and F is above 60 with c from 0.5 to 2. A
// duty 0 shows nothing; where it is never 0, the smallest magnitude may be below the zone. Errors: none thrown.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "control/search/fit.hpp"
#include "control/search/output_error_search.hpp"

namespace control {

// Where a motor begins to turn: above the one duty, at the other.
struct DeadZone {
  double from_duty = 0, to_duty = 0;
};

struct FittedRun {
  OutputErrorSearch& search;
  const Recording& recording;
  const Fit& fit;
  const SearchPoint& point;
};

std::optional<DeadZone> dead_zone_evidence(std::span<const FittedRun> runs);
std::vector<double> beyond_dead_zone(std::vector<double> duty, const DeadZone& zone);  // 0 below it
std::string dead_zone_in_words(const DeadZone& zone);

}  // namespace control
