// Which phase margins have an iso-damped solution at a crossover; (5) is that of tune.hpp.
//
// Errors: throws std::invalid_argument quoting the bad value.
#pragma once

#include <optional>

#include "control/models/transfer_function.hpp"
#include "control/tuning/tuning_equations.hpp"

namespace control {

// Refuse what cannot be tuned for: a plant whose gain is not positive, a crossover out of range, a plant whose response
// there overflows.
void check_tuned_plant(const FractionalModel& plant);
void check_crossover(double omega_rad_s);
void check_response(const FractionalModel& plant, const TuningDemand& at_crossover);

// Every phase margin that has an iso-damped solution at this crossover: the ends of the open interval, none if there
// is none. Within it tune still refuses what is not sound; it may reach below 0, where every loop is unstable.
struct PhaseMarginRange {
  double low_deg = 0, high_deg = 0;
};
std::optional<PhaseMarginRange> feasible_phase_margins(const FractionalModel& plant, double gain_crossover_rad_s,
                                                       bool is_velocity_loop = false);

}  // namespace control
