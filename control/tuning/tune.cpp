// The closed form, its condition, and what to offer instead.
#include "control/tuning/tune.hpp"

#include <cmath>
#include <sstream>

#include "base/invalid_argument.hpp"
#include "control/tuning/feasible_margins.hpp"
#include "control/tuning/tuning_alternatives.hpp"
#include "control/tuning/tuning_equations.hpp"
#include "control/tuning/tuning_refusal.hpp"

namespace control {
namespace {

[[noreturn]] void refuse(const char* what, double value) { base::throw_invalid("tuning: ", what, ' ', value); }

void check(const TuningSpec& spec) {
  check_crossover(spec.gain_crossover_rad_s);
  if (!(spec.phase_margin_deg > 0 && spec.phase_margin_deg < 180)) {
    refuse("phase_margin_deg must lie in (0, 180), is", spec.phase_margin_deg);
  }
  if (spec.mu && !(*spec.mu > 0 && *spec.mu < 2)) refuse("mu must lie in (0, 2), is", *spec.mu);
  if (!(spec.period_s >= 0 && std::isfinite(spec.period_s))) {
    refuse("period_s must be 0 or positive, is", spec.period_s);
  }
}

std::string name_of(const TuningSpec& spec) {
  if (!spec.mu) return "as asked: iso-damped";
  if (*spec.mu <= 1) return "as asked: mu fixed, iso-damping dropped";
  return "as asked: mu fixed, above 1: amplifies noise more than a derivative, not in the paper; iso-damping dropped";
}

// The specification has a solution, but its numbers are not what the loop does.
std::string why_not_sound(const TunedController& design) {
  const auto& [kp, kd, mu] = design.controller;
  const Margins& achieved = design.achieved;
  std::ostringstream text;
  text.precision(6);
  text << "kp = " << kp << ", kd = " << kd << ", mu = " << mu << " meets it at " << design.spec.gain_crossover_rad_s
       << " rad/s, but ";
  if (!achieved.is_closed_loop_stable) {
    text << "the closed loop is unstable";
  } else if (!design.sampled.is_closed_loop_stable) {
    text << "the closed loop is unstable as the robot runs it, which holds its duty for " << design.spec.period_s
         << " s: of the phase margin of " << *achieved.phase_margin_deg << " degrees that takes "
         << design.spec.gain_crossover_rad_s * design.spec.period_s / 2 * kDegPerRad;
    return text.str();
  }
  if (is_ruled_elsewhere(design)) {
    text << (achieved.is_closed_loop_stable ? "" : ": ") << "the gain is 1 also at " << *achieved.gain_crossover_rad_s
         << " rad/s, where the phase margin is " << *achieved.phase_margin_deg << " degrees";
  }
  return text.str();
}

}  // namespace

TuningResult tune(const FractionalModel& plant, const TuningSpec& spec) {
  check_tuned_plant(plant);
  check(spec);
  const PlantOnAxis on_axis{plant, spec.is_velocity_loop};
  const TuningDemand demand = tuning_demand(on_axis, std::log(spec.gain_crossover_rad_s), spec.phase_margin_deg);
  check_response(plant, demand);
  TuningResult result;
  result.theta_deg = demand.theta_rad * kDegPerRad;
  result.phase_fall = demand.phase_fall;
  if (feasible_theta(spec.mu, demand.phase_fall).contains(demand.theta_rad)) {  // (5)
    const double mu = spec.mu ? *spec.mu : iso_damping_mu(demand);
    auto design = tuned_controller(plant, spec, mu, name_of(spec));
    result.is_feasible = design && is_sound(*design);
    if (!result.is_feasible) result.reason = design ? why_not_sound(*design) : why_no_controller(spec, demand, mu);
    (result.is_feasible ? result.tuned : result.refused) = std::move(design);
  } else {
    result.reason = why_no_solution(spec, result.theta_deg, result.phase_fall);
  }
  if (!result.is_feasible) {
    result.nearest = nearest_designs(plant, spec);
    result.relaxed = relaxed_designs(plant, spec);
  }
  return result;
}

}  // namespace control
