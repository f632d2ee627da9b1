// The demand on the controller comes from measured numbers; the rest is that of tune.
#include "control/tuning/measured_tuning.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <utility>

#include "base/invalid_argument.hpp"
#include "control/tuning/tuning_alternatives.hpp"
#include "control/tuning/tuning_equations.hpp"
#include "control/tuning/tuning_ranges.hpp"
#include "control/tuning/tuning_refusal.hpp"

namespace control {
namespace {

constexpr double kSameCrossover = 1e-9;  // relative
constexpr double kInsideDeg = 0.1;       // how far inside the margins that have a solution an offer lies
constexpr int kMargins = 1800;           // tried, over all of them
// What the method itself may be wrong by, as three_tones.hpp states it: no noise, so no sigma of the record has it.
constexpr double kModulusError = 0.014, kPhaseErrorDeg = 0.3, kPhaseFallError = 0.043;

void check(const MeasuredPlant& plant, const TuningSpec& spec) {
  const double measured_rad_s = plant.at_crossover().omega_rad_s;
  if (!(std::abs(spec.gain_crossover_rad_s / measured_rad_s - 1) <= kSameCrossover)) {
    base::throw_invalid("tuning: the plant was measured at ", measured_rad_s, " rad/s, the crossover asked for is ",
                        spec.gain_crossover_rad_s);
  }
  if (!(spec.phase_margin_deg > 0 && spec.phase_margin_deg < 180)) {
    base::throw_invalid("tuning: phase_margin_deg must lie in (0, 180), is ", spec.phase_margin_deg);
  }
  if (spec.mu && !(*spec.mu > 0 && *spec.mu < 2)) base::throw_invalid("tuning: mu must lie in (0, 2), is ", *spec.mu);
  if (spec.is_velocity_loop) base::throw_invalid("tuning: what was measured is the position, not the velocity");
}

TuningDemand demand_of(const MeasuredPoint& at, double phase_fall, double phase_margin_deg) {
  const double theta_rad = phase_margin_deg / kDegPerRad - std::numbers::pi - at.phase_rad;  // (2)
  return {std::log(at.omega_rad_s), theta_rad, phase_fall, std::log(at.modulus)};
}

double loop_gain(const MeasuredPoint& at, const FopdController& controller) {
  return at.modulus * std::abs(ControllerOnAxis{controller}.at(std::log(at.omega_rad_s)).value);
}

// d ln|L|/d ln ω at the crossover, by the measured moduli.
double gain_slope(const MeasuredPlant& plant, const FopdController& controller) {
  const MeasuredPoint &low = plant.points.front(), &high = plant.points.back();
  return std::log(loop_gain(high, controller) / loop_gain(low, controller)) /
         std::log(high.omega_rad_s / low.omega_rad_s);
}

std::string why_not_sound(const MeasuredPlant& plant, const FopdController& controller) {
  const double low = loop_gain(plant.points.front(), controller), high = loop_gain(plant.points.back(), controller);
  if (low > 1 && high < 1) return {};
  std::ostringstream text;
  text.precision(4);
  text << "the loop would cross over elsewhere: its gain is " << low << " at " << plant.points.front().omega_rad_s
       << " rad/s and " << high << " at " << plant.points.back().omega_rad_s
       << " rad/s, and must fall through 1 between";
  return text.str();
}

// The sound controller for a phase margin and a mu, none: iso-damped; if there is one.
std::optional<FopdController> sound_controller(const MeasuredPlant& plant, const TuningSpec& spec) {
  const TuningDemand demand = demand_of(plant.at_crossover(), plant.phase_fall, spec.phase_margin_deg);
  if (!feasible_theta(spec.mu, demand.phase_fall).contains(demand.theta_rad)) return std::nullopt;
  const auto controller = controller_for(demand, spec.mu ? *spec.mu : iso_damping_mu(demand));
  return controller && why_not_sound(plant, *controller).empty() ? controller : std::nullopt;
}

void add_offer(const MeasuredPlant& plant, const TuningSpec& spec, std::string name,
               std::vector<MeasuredOffer>& offers) {
  const auto controller = sound_controller(plant, spec);
  if (!controller) return;
  const std::string remark = remark_on(*controller, spec.gain_crossover_rad_s);
  offers.push_back({std::move(name) + (remark.empty() ? "" : "; " + remark), spec, *controller});
}

// The range of (5) and margins all over it, the nearest to what was asked for first.
void add_nearest(const MeasuredPlant& plant, const TuningSpec& asked, MeasuredTuning& tuning) {
  const double plain_deg = -demand_of(plant.at_crossover(), plant.phase_fall, 0).theta_rad * kDegPerRad;
  const ThetaRange theta = feasible_theta(asked.mu, plant.phase_fall);
  const double inside_deg = std::min(kInsideDeg, (theta.high_rad - theta.low_rad) / 4 * kDegPerRad);
  const double low_deg = std::max(plain_deg + theta.low_rad * kDegPerRad + inside_deg, kSmallestMarginDeg);
  const double high_deg = std::min(plain_deg + theta.high_rad * kDegPerRad - inside_deg, kLargestMarginDeg);
  if (!(low_deg < high_deg)) return;
  std::vector<double> margins_deg{std::clamp(asked.phase_margin_deg, low_deg, high_deg)};
  for (int i = 0; i <= kMargins; ++i) margins_deg.push_back(low_deg + i * (high_deg - low_deg) / kMargins);
  std::ranges::sort(margins_deg, {}, [&](double margin) { return std::abs(margin - asked.phase_margin_deg); });
  const std::string kept = asked.mu ? "same mu" : "iso-damped";
  for (const double margin_deg : margins_deg) {
    TuningSpec spec = asked;
    spec.phase_margin_deg = margin_deg;
    add_offer(plant, spec, kept + ", same crossover, nearest phase margin", tuning.nearest);
    if (!tuning.nearest.empty()) return;
  }
}

void add_relaxed(const MeasuredPlant& plant, const TuningSpec& asked, MeasuredTuning& tuning) {
  const TuningDemand demand = demand_of(plant.at_crossover(), plant.phase_fall, asked.phase_margin_deg);
  for (const auto& [mu, name] : relaxed_orders(demand, asked)) {
    TuningSpec spec = asked;
    spec.mu = mu;
    add_offer(plant, spec, name, tuning.relaxed);
  }
}

std::string refusal_of(const MeasuredPlant& plant, const TuningSpec& spec, const TuningDemand& demand) {
  if (!feasible_theta(spec.mu, demand.phase_fall).contains(demand.theta_rad)) {
    return why_no_solution(spec, demand.theta_rad * kDegPerRad, demand.phase_fall);
  }
  const double mu = spec.mu ? *spec.mu : iso_damping_mu(demand);
  const auto controller = controller_for(demand, mu);
  return controller ? why_not_sound(plant, *controller) : why_no_controller(spec, demand, mu);
}

void add_sigmas(const MeasuredPlant& plant, MeasuredTuning& tuning) {
  const MeasuredPoint& at = plant.at_crossover();
  const double slope = std::abs(gain_slope(plant, *tuning.controller));
  const double phase_fall_sigma = std::hypot(plant.phase_fall_sigma, kPhaseFallError * plant.phase_fall);
  tuning.phase_margin_sigma_deg = std::hypot(at.sigma * kDegPerRad, kPhaseErrorDeg);
  tuning.crossover_sigma_rad_s = std::hypot(at.sigma, kModulusError) / slope * at.omega_rad_s;
  tuning.phase_slope_sigma_deg_per_rad_s = phase_fall_sigma * kDegPerRad / at.omega_rad_s;
}

}  // namespace

MeasuredTuning tune_measured(const MeasuredPlant& plant, const TuningSpec& spec) {
  MeasuredTuning tuning;
  tuning.reason = plant.refusal;
  if (!plant.refusal.empty()) return tuning;
  check(plant, spec);
  const TuningDemand demand = demand_of(plant.at_crossover(), plant.phase_fall, spec.phase_margin_deg);
  tuning.theta_deg = demand.theta_rad * kDegPerRad;
  tuning.phase_fall = demand.phase_fall;
  tuning.controller = sound_controller(plant, spec);
  if (tuning.controller) {
    add_sigmas(plant, tuning);
  } else {
    tuning.reason = refusal_of(plant, spec, demand);
    add_nearest(plant, spec, tuning);
    add_relaxed(plant, spec, tuning);
  }
  return tuning;
}

}  // namespace control
