// One sentence for each condition.
#include "control/tuning/tuning_refusal.hpp"

#include <sstream>

#include "control/tuning/tuning_equations.hpp"

namespace control {
namespace {

std::string no_phase_to_add(const TuningSpec& spec, double theta_deg) {
  std::ostringstream text;
  text.precision(6);
  const double plant_deg = spec.phase_margin_deg - theta_deg;
  text << "the plant with a plain gain has a phase margin of " << plant_deg << " degrees at "
       << spec.gain_crossover_rad_s << " rad/s, " << (theta_deg < 0 ? "more than" : "just") << " the "
       << spec.phase_margin_deg << " asked for, and a fractional PD can only add phase (theta = " << theta_deg
       << " degrees)";
  return text.str();
}

std::string why_not_with_mu(const TuningSpec& spec, double theta_deg) {
  if (theta_deg < 0) return no_phase_to_add(spec, theta_deg);
  std::ostringstream text;
  text.precision(6);
  text << "the controller would have to add theta = " << theta_deg << " degrees of phase at "
       << spec.gain_crossover_rad_s << " rad/s, and with mu = " << *spec.mu << " it adds less than " << *spec.mu * 90
       << "; ";
  if (theta_deg < 180) {
    text << "a mu above " << theta_deg / 90 << " would do";
  } else {
    text << "no mu below 2 would do";
  }
  return text.str();
}

std::string why_not_iso_damped(const TuningSpec& spec, double theta_deg, double phase_fall) {
  if (theta_deg <= 0) return no_phase_to_add(spec, theta_deg);
  std::ostringstream text;
  text.precision(6);
  if (theta_deg >= 90) {
    text << "the controller would have to add theta = " << theta_deg << " degrees of phase at "
         << spec.gain_crossover_rad_s << " rad/s, and a fractional PD with mu up to 1 adds less than 90";
    return text.str();
  }
  const double bound = largest_phase_fall(theta_deg / kDegPerRad);
  text << "at " << spec.gain_crossover_rad_s << " rad/s the phase of the plant falls by R = " << phase_fall
       << " rad per unit of ln omega, and a fractional PD with mu up to 1 that adds theta = " << theta_deg
       << " degrees can make up for less than sin(2 theta)/2 = " << bound;
  if (phase_fall >= 0.5) text << " (and never for more than 0.5, so no phase margin is iso-damped at this crossover)";
  return text.str();
}

}  // namespace

std::string why_no_controller(const TuningSpec& spec, const TuningDemand& demand, double mu) {
  std::ostringstream text;
  text.precision(6);
  const double derivative = derivative_part(demand.theta_rad, mu);
  if (derivative <= kLargestDerivative) {
    text << "the plant's gain at " << spec.gain_crossover_rad_s << " rad/s is e^" << demand.log_plant_gain
         << ", and a controller for it with mu = " << mu
         << " needs a kp or kd that is no normal number of double precision; check the plant's units";
    return text.str();
  }
  text << "at " << spec.gain_crossover_rad_s
       << " rad/s the controller would have to add theta = " << demand.theta_rad * kDegPerRad
       << " degrees, which is all that mu = " << mu << " can add: kd omega^mu would be above " << kLargestDerivative
       << ", and nothing would be left of the proportional part; ";
  if (spec.mu) {
    text << "ask for a larger mu or a smaller phase margin";
  } else {
    text << "the phase of the plant hardly falls there (R = " << demand.phase_fall
         << " rad per unit of ln omega): ask with a fixed mu above " << mu;
  }
  return text.str();
}

std::string why_no_solution(const TuningSpec& spec, double theta_deg, double phase_fall) {
  return spec.mu ? why_not_with_mu(spec, theta_deg) : why_not_iso_damped(spec, theta_deg, phase_fall);
}

}  // namespace control
