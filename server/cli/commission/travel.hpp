// Whether the robot's own limits keep it within the length that the person measured. Facts in, a finding out.
//
// The limits count from the robot's zero, and each of its runs begins with a new one, where the run before has ended:
// how far that lies from where the ruler was laid is believed, with its sd.
// Errors: none.
#pragma once

#include <optional>

#include "server/cli/commission/finding.hpp"

namespace server::cli {

struct TravelFacts {
  double ahead_m = 0, behind_m = 0;              // free, by the person's ruler, from where the robot lay
  double limit_min_m = -100, limit_max_m = 100;  // the robot's parameters
  double believed_m = 0, zero_m = 0;  // after the push that the person watched; of its zero now, from the ruler's
  std::optional<double> believed_sd_m = 0, zero_sd_m = 0;  // none: the robot does not know
  std::optional<double> measured_m{};                      // the same by the ruler
  std::optional<double> gain_m_s{};                        // per duty
  double duty_max = 1, worst_stop_ms = 0;
};
// None where either is not known.
std::optional<double> sum_of(const std::optional<double>& one_m, const std::optional<double>& other_m);
StepFinding judge_free_travel(const TravelFacts& facts);

}  // namespace server::cli
