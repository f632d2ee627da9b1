// Walks out from the specification to where it becomes feasible, and lists the relaxed designs.
#include "control/tuning_alternatives.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

#include "control/tuning_equations.hpp"

namespace control {
namespace {

using std::numbers::pi;

constexpr double kInsideDeg = 0.1, kInsideLogOmega = 1e-3;  // how far inside the feasible region an offer lies
constexpr double kSearchStep = 0.02, kSearchWidth = 13.8;   // in ln ω; ln 1e6
constexpr double kPracticalMu = 0.9;

// Whether the specification would have a solution if its crossover were here.
bool is_feasible_at(const PlantOnAxis& plant, const TuningSpec& spec, double log_omega) {
  const TuningDemand demand = tuning_demand(plant, log_omega, spec.phase_margin_deg);
  return feasible_theta(spec.mu, demand.phase_fall).contains(demand.theta_rad);
}

double mu_for(const TuningSpec& spec, const TuningDemand& demand) {
  return spec.mu ? *spec.mu : iso_damping_mu(demand);
}

std::optional<TuningSpec> nearest_phase_margin(const PlantOnAxis& plant, TuningSpec spec) {
  const TuningDemand demand = tuning_demand(plant, std::log(spec.gain_crossover_rad_s), spec.phase_margin_deg);
  const ThetaRange theta = feasible_theta(spec.mu, demand.phase_fall);
  const double at_theta_0_deg = spec.phase_margin_deg - demand.theta_rad * kDegPerRad;
  const double low_deg = std::max(0.0, at_theta_0_deg + theta.low_rad * kDegPerRad);
  const double high_deg = std::min(180.0, at_theta_0_deg + theta.high_rad * kDegPerRad);
  if (low_deg >= high_deg) return std::nullopt;
  const double inside_deg = std::min(kInsideDeg, (high_deg - low_deg) / 4);
  spec.phase_margin_deg = std::clamp(spec.phase_margin_deg, low_deg + inside_deg, high_deg - inside_deg);
  return spec;
}

// Walks one way along the axis until the specification is feasible, and back to just inside the border.
std::optional<TuningSpec> nearest_crossover(const PlantOnAxis& plant, TuningSpec spec, double step) {
  const double start = std::log(spec.gain_crossover_rad_s);
  for (int i = 1; i * kSearchStep <= kSearchWidth; ++i) {
    double inside = start + i * step, outside = inside - step;
    if (std::abs(inside) > kLargestLogOmega) return std::nullopt;
    if (!is_feasible_at(plant, spec, inside)) continue;
    const double found = inside;
    for (int halving = 0; halving < 45; ++halving) {
      const double middle = (inside + outside) / 2;
      (is_feasible_at(plant, spec, middle) ? inside : outside) = middle;
    }
    const double depth = std::min(kInsideLogOmega, std::abs(found - inside));
    spec.gain_crossover_rad_s = std::exp(inside + std::copysign(depth, step));
    return spec;
  }
  return std::nullopt;
}

// What else there is to know: the numbers of the specification are not the whole loop.
std::string remark(const TuningSpec& spec, const Margins& achieved) {
  std::ostringstream text;
  text.precision(4);
  const double crossover = achieved.gain_crossover_rad_s.value_or(spec.gain_crossover_rad_s);
  if (std::abs(crossover / spec.gain_crossover_rad_s - 1) > 1e-6) {
    text << "; the gain is 1 also at " << crossover << " rad/s, where the phase margin is less";
  }
  if (!achieved.is_closed_loop_stable) text << "; the closed loop is unstable";
  return text.str();
}

}  // namespace

TunedController tuned_controller(const FractionalModel& plant, const TuningSpec& spec, double mu, std::string name) {
  const PlantOnAxis on_axis{plant, spec.is_velocity_loop};
  const TuningDemand demand = tuning_demand(on_axis, std::log(spec.gain_crossover_rad_s), spec.phase_margin_deg);
  const FopdController controller = controller_for(demand, mu);
  Margins achieved = margins({plant, controller, spec.is_velocity_loop});
  name += remark(spec, achieved);
  return {std::move(name), spec, controller, std::move(achieved)};
}

std::vector<TunedController> nearest_designs(const FractionalModel& plant, const TuningSpec& spec) {
  const PlantOnAxis on_axis{plant, spec.is_velocity_loop};
  const std::string kept = spec.mu ? "same mu" : "iso-damped";
  std::vector<TunedController> designs;
  const auto offer = [&](const std::optional<TuningSpec>& found, const std::string& name) {
    if (!found) return;
    const auto demand = tuning_demand(on_axis, std::log(found->gain_crossover_rad_s), found->phase_margin_deg);
    designs.push_back(tuned_controller(plant, *found, mu_for(*found, demand), name));
  };
  offer(nearest_phase_margin(on_axis, spec), kept + ", same crossover, nearest phase margin");
  offer(nearest_crossover(on_axis, spec, -kSearchStep), kept + ", same phase margin, nearest crossover below");
  offer(nearest_crossover(on_axis, spec, kSearchStep), kept + ", same phase margin, nearest crossover above");
  return designs;
}

std::vector<TunedController> relaxed_designs(const FractionalModel& plant, const TuningSpec& spec) {
  const PlantOnAxis on_axis{plant, spec.is_velocity_loop};
  const TuningDemand demand = tuning_demand(on_axis, std::log(spec.gain_crossover_rad_s), spec.phase_margin_deg);
  std::vector<TunedController> designs;
  const auto offer = [&](double mu, const std::string& name) {
    TuningSpec with_mu = spec;
    with_mu.mu = mu;
    designs.push_back(tuned_controller(plant, with_mu, mu, name));
  };
  if (demand.theta_rad < 0 || demand.theta_rad >= pi) return designs;
  if (demand.theta_rad < kPracticalMu * pi / 2 && spec.mu != kPracticalMu)
    offer(kPracticalMu, "iso-damping dropped, mu fixed at 0.9");
  const bool is_iso_damped = demand.phase_fall < largest_phase_fall(demand.theta_rad);
  if (is_iso_damped) {
    offer(iso_damping_mu(demand), "mu left free: iso-damped");
  } else if (demand.theta_rad < pi / 2) {
    offer(1, "iso-damping dropped, flattest phase with mu up to 1: the classical PD");  // (4) rises with mu
  }
  if (!is_iso_damped && demand.theta_rad > 0) {
    offer(iso_damping_mu(demand), "iso-damped with mu > 1: amplifies noise more than a derivative, not in the paper");
  }
  return designs;
}

}  // namespace control
