// What a crossover and a phase margin ask of the controller, and the controller that gives it: (2) to (6) of tune.hpp.
//
// Where q - θ of (3) is a rounding error, kd ω^μ has no digits: the orders of a plant that are nearly 0 make R so small
// that (4) is solved there. Then there is no controller, rather than an infinite or a negative one.
//
// Errors: none; the arguments have been checked.
#pragma once

#include <optional>

#include "control/responses/frequency_response.hpp"

namespace control {

struct TuningDemand {
  double log_omega = 0;
  double theta_rad = 0;   // θ of (2): the phase that the controller must add
  double phase_fall = 0;  // R of (2), always positive
  double log_plant_gain = 0;
};

TuningDemand tuning_demand(const PlantOnAxis& plant, double log_omega, double phase_margin_deg);

// sin(2θ)/2, the bound on R in (5); 0 where θ is outside (0, 90°).
double largest_phase_fall(double theta_rad);

// The θ for which there is a solution: (5), solved for θ; with a fixed mu, 0 ≤ θ < μπ/2.
struct ThetaRange {
  double low_rad = 0, high_rad = 0;  // empty if low ≥ high
  bool has_low_end = false;

  bool contains(double theta_rad) const {
    return theta_rad < high_rad && (theta_rad > low_rad || (has_low_end && theta_rad == low_rad));
  }
};

ThetaRange feasible_theta(std::optional<double> mu, double phase_fall);

// The solution of (4). Needs 0 < θ < 180°.
double iso_damping_mu(const TuningDemand& demand);

// From this kd ω^μ on the proportional part of the controller is smaller than the accuracy that tune.hpp states.
inline constexpr double kLargestDerivative = 1e9;

// (3): kd ω^μ, infinite where q - θ is a rounding error. Needs 0 ≤ θ < μπ/2.
double derivative_part(double theta_rad, double mu);

// (3) and (6). Needs 0 ≤ θ < μπ/2. None if kd ω^μ exceeds kLargestDerivative, or if kp or kd is no normal number.
std::optional<FopdController> controller_for(const TuningDemand& demand, double mu);

}  // namespace control
