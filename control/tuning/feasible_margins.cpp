// The ends of (5), solved for the phase margin.
#include "control/tuning/feasible_margins.hpp"

#include <cmath>

#include "base/invalid_argument.hpp"

namespace control {
namespace {

[[noreturn]] void refuse(const char* what, double value) { base::throw_invalid("tuning: ", what, ' ', value); }

}  // namespace

void check_tuned_plant(const FractionalModel& plant) {
  check(plant);
  if (plant.kp < 0) refuse("the plant's kp must be positive (turn the sign of the duty), is", plant.kp);
}

void check_crossover(double omega_rad_s) {
  if (!(omega_rad_s > 0 && std::abs(std::log(omega_rad_s)) <= kLargestLogOmega)) {
    refuse("gain_crossover_rad_s must be positive, and within 1e-65 and 1e65, is", omega_rad_s);
  }
}

void check_response(const FractionalModel& plant, const TuningDemand& at_crossover) {
  const auto& [log_omega, theta_rad, phase_fall, log_plant_gain] = at_crossover;
  if (std::isfinite(theta_rad) && std::isfinite(phase_fall) && std::isfinite(log_plant_gain)) return;
  base::throw_invalid("tuning: the plant's response at ", std::exp(log_omega),
                      " rad/s overflows double precision with ", "b1 = ", plant.b1, ", b2 = ", plant.b2,
                      ", b3 = ", plant.b3, "; divide kp, b1, b2 and b3 by b3, and check the units");
}

std::optional<PhaseMarginRange> feasible_phase_margins(const FractionalModel& plant, double gain_crossover_rad_s,
                                                       bool is_velocity_loop) {
  check_tuned_plant(plant);
  check_crossover(gain_crossover_rad_s);
  const PlantOnAxis on_axis{plant, is_velocity_loop};
  const TuningDemand demand = tuning_demand(on_axis, std::log(gain_crossover_rad_s), 0);
  check_response(plant, demand);
  const ThetaRange theta = feasible_theta(std::nullopt, demand.phase_fall);  // (5)
  if (theta.low_rad >= theta.high_rad) return std::nullopt;
  const double plain_deg = -demand.theta_rad * kDegPerRad;  // the phase margin with θ = 0
  return PhaseMarginRange{plain_deg + theta.low_rad * kDegPerRad, plain_deg + theta.high_rad * kDegPerRad};
}

}  // namespace control
