// Walks out from the specification to where a sound design begins, and lists the relaxed designs.
#include "control/tuning/tuning_alternatives.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "control/tuning/tuning_equations.hpp"
#include "control/tuning/tuning_ranges.hpp"

namespace control {
namespace {

using std::numbers::pi;

constexpr double kInsideDeg = 0.1, kInsideLogOmega = 1e-3;  // how far inside the region of sound designs an offer lies
constexpr double kSearchStep = 0.02, kSearchWidth = 13.8;   // in ln ω; ln 1e6
constexpr int kUnsoundSteps =
    5;  // at a time where (5) holds: telling whether a design is sound takes a hundred times as long
constexpr int kMargins = 60, kFewMargins = 12;  // tried in the range of a crossover
constexpr int kHalvings = 10;                   // of a step, to find a border
constexpr double kNearestToEnd = 1e-6;          // of a range whose ends do not belong to it
constexpr double kPracticalMu = 0.9;

struct DegreeRange {
  double low = 0, high = 0;
};

// Looks for sound designs near a specification.
class Search {
 public:
  Search(const FractionalModel& plant, const TuningSpec& spec)
      : plant_{plant},
        on_axis_{plant, spec.is_velocity_loop},
        spec_{spec},
        lowest_{std::log(std::min(kLowestCrossover_rad_s, spec.gain_crossover_rad_s))},
        highest_{std::log(std::max(kHighestCrossover_rad_s, spec.gain_crossover_rad_s))} {}

  // At the specification's crossover, or another, the phase margin nearest to the one asked for. The ends of the range
  // that (5) allows are known, so that a narrow one is not missed; within it `count` margins are tried.
  std::optional<TunedController> nearest_margin(double omega_rad_s, int count, const std::string& name) const {
    const auto range = margins_at(omega_rad_s);
    if (!range) return std::nullopt;
    const double asked = spec_.phase_margin_deg, step = (range->high - range->low) / count;
    std::vector<double> margins{std::clamp(asked, range->low, range->high)};
    for (int i = 0; i <= count; ++i) margins.push_back(range->low + i * step);
    std::ranges::sort(margins, {}, [asked](double margin) { return std::pair{std::abs(margin - asked), margin}; });
    const auto first =
        std::ranges::find_if(margins, [&](double margin) { return design({omega_rad_s, margin}, name).has_value(); });
    if (first == margins.end()) return std::nullopt;
    if (first == margins.begin()) return design({omega_rad_s, *first}, name);
    double sound = *first, outside = sound + std::copysign(step, asked - sound);
    for (int halving = 0; halving < kHalvings; ++halving) {
      const double middle = (sound + outside) / 2;
      (design({omega_rad_s, middle}, name) ? sound : outside) = middle;
    }
    const double depth = std::min(kInsideDeg, std::abs(*first - sound));
    auto inside = design({omega_rad_s, sound + std::copysign(depth, *first - sound)}, name);
    return inside ? inside : design({omega_rad_s, *first}, name);
  }

  // Walks one way along the axis until there is a sound design for this phase margin, and back to just inside the
  // border.
  std::optional<TunedController> nearest_crossover(double step, const std::string& name) const {
    const double start = std::log(spec_.gain_crossover_rad_s), margin = spec_.phase_margin_deg;
    for (double log_omega = start + step, before = start; std::abs(log_omega - start) <= kSearchWidth;) {
      if (!is_offered(log_omega)) return std::nullopt;
      const bool has_solution = mu_for({std::exp(log_omega), margin}).has_value();
      if (has_solution && design({std::exp(log_omega), margin}, name)) {
        return just_inside(log_omega, before, name);
      }
      before = log_omega;
      log_omega += has_solution ? kUnsoundSteps * step : step;
    }
    return std::nullopt;
  }

  // The nearest crossover that has a sound design with any phase margin.
  std::optional<TunedController> nearest_of_all(const std::string& name) const {
    constexpr double kStep = kUnsoundSteps * kSearchStep;
    const double start = std::log(spec_.gain_crossover_rad_s);
    for (int i = 1; i * kStep <= kSearchWidth; ++i) {
      for (const double log_omega : {start - i * kStep, start + i * kStep}) {
        if (!is_offered(log_omega)) continue;
        if (auto found = nearest_margin(std::exp(log_omega), kFewMargins, name)) return found;
      }
    }
    return std::nullopt;
  }

  // At the specification's crossover, where (5) holds in `open`. A border lies on its sound side.
  std::vector<PhaseMarginRange> sound_margins(const DegreeRange& open) const {
    const double width = open.high - open.low, asked = spec_.phase_margin_deg;
    std::vector<double> margins{open.low + kNearestToEnd * width, open.high - kNearestToEnd * width};
    for (int i = 1; i < kMargins; ++i) margins.push_back(open.low + i * width / kMargins);
    if (open.low < asked && asked < open.high) margins.push_back(asked);
    std::ranges::sort(margins);
    std::vector<PhaseMarginRange> found;
    std::optional<double> last;
    bool was_sound = false;
    for (const double margin : margins) {
      const bool is_sound_here = is_sound_at(margin);
      if (is_sound_here && !was_sound) found.push_back({last ? border(margin, *last) : open.low, margin});
      if (!is_sound_here && was_sound) found.back().high_deg = border(*last, margin);
      was_sound = is_sound_here;
      last = margin;
    }
    if (was_sound) found.back().high_deg = open.high;
    return found;
  }

 private:
  struct Target {
    double gain_crossover_rad_s, phase_margin_deg;
  };

  bool is_offered(double log_omega) const { return log_omega >= lowest_ && log_omega <= highest_; }

  // Of the equations' solution, if there is one.
  std::optional<double> mu_for(const Target& target) const {
    const TuningDemand demand = tuning_demand(on_axis_, std::log(target.gain_crossover_rad_s), target.phase_margin_deg);
    if (!feasible_theta(spec_.mu, demand.phase_fall).contains(demand.theta_rad)) return std::nullopt;
    return spec_.mu ? *spec_.mu : iso_damping_mu(demand);
  }

  // The sound design, if there is one.
  std::optional<TunedController> design(const Target& target, const std::string& name) const {
    const auto mu = mu_for(target);
    if (!mu) return std::nullopt;
    TuningSpec spec = spec_;
    spec.gain_crossover_rad_s = target.gain_crossover_rad_s;
    spec.phase_margin_deg = target.phase_margin_deg;
    auto found = tuned_controller(plant_, spec, *mu, name);
    return found && is_sound(*found) ? std::move(found) : std::nullopt;
  }

  bool is_sound_at(double margin_deg) const { return design({spec_.gain_crossover_rad_s, margin_deg}, "").has_value(); }

  double border(double sound, double outside) const {
    for (int halving = 0; halving < kHalvings; ++halving) {
      const double middle = (sound + outside) / 2;
      (is_sound_at(middle) ? sound : outside) = middle;
    }
    return sound;
  }

  std::optional<TunedController> just_inside(double found, double outside, const std::string& name) const {
    const double margin = spec_.phase_margin_deg;
    double inside = found;
    for (int halving = 0; halving < kHalvings; ++halving) {
      const double middle = (inside + outside) / 2;
      (design({std::exp(middle), margin}, name) ? inside : outside) = middle;
    }
    const double depth = std::min(kInsideLogOmega, std::abs(found - inside));
    auto offer = design({std::exp(inside + std::copysign(depth, found - inside)), margin}, name);
    return offer ? offer : design({std::exp(found), margin}, name);
  }

  // The phase margins that (5) or the fixed mu allows at this crossover, a little less than that at either end.
  std::optional<DegreeRange> margins_at(double omega_rad_s) const {
    const TuningDemand demand = tuning_demand(on_axis_, std::log(omega_rad_s), 0);
    const ThetaRange theta = feasible_theta(spec_.mu, demand.phase_fall);
    const double at_theta_0_deg = -demand.theta_rad * kDegPerRad;
    const double low = std::max(0.0, at_theta_0_deg + theta.low_rad * kDegPerRad);
    const double high = std::min(180.0, at_theta_0_deg + theta.high_rad * kDegPerRad);
    if (low >= high) return std::nullopt;
    const double inside = std::min(kInsideDeg, (high - low) / 4);
    const DegreeRange offered{std::max(low + inside, kSmallestMarginDeg), std::min(high - inside, kLargestMarginDeg)};
    return offered.low < offered.high ? std::optional{offered} : std::nullopt;
  }

  const FractionalModel& plant_;
  PlantOnAxis on_axis_;
  const TuningSpec& spec_;
  double lowest_, highest_;  // ln ω of the crossovers that are offered
};

}  // namespace

std::optional<TunedController> tuned_controller(const FractionalModel& plant, const TuningSpec& spec, double mu,
                                                std::string name) {
  const PlantOnAxis on_axis{plant, spec.is_velocity_loop};
  const TuningDemand demand = tuning_demand(on_axis, std::log(spec.gain_crossover_rad_s), spec.phase_margin_deg);
  const auto controller = controller_for(demand, mu);
  if (!controller) return std::nullopt;
  const std::string remark = remark_on(*controller, spec.gain_crossover_rad_s);
  if (!remark.empty()) name += "; " + remark;
  const Margins achieved = margins({plant, *controller, spec.is_velocity_loop});
  if (spec.period_s == 0) return TunedController{std::move(name), spec, *controller, achieved, achieved};
  const FractionalModel held = with_hold(plant, spec.period_s);
  const Margins sampled = margins({held, *controller, spec.is_velocity_loop});
  return TunedController{std::move(name), spec, *controller, achieved, sampled};
}

std::vector<PhaseMarginRange> sound_phase_margins(const FractionalModel& plant, const TuningSpec& spec) {
  const auto solved = feasible_phase_margins(plant, spec.gain_crossover_rad_s, spec.is_velocity_loop);
  if (!solved) return {};
  const DegreeRange open{std::max(0.0, solved->low_deg), std::min(180.0, solved->high_deg)};
  if (open.low >= open.high) return {};
  TuningSpec iso_damped = spec;
  iso_damped.mu.reset();
  return Search{plant, iso_damped}.sound_margins(open);
}

std::vector<TunedController> nearest_designs(const FractionalModel& plant, const TuningSpec& spec) {
  const Search search{plant, spec};
  const std::string kept = spec.mu ? "same mu" : "iso-damped";
  std::vector<TunedController> designs;
  const auto offer = [&designs](std::optional<TunedController> found) {
    if (found) designs.push_back(std::move(*found));
  };
  offer(search.nearest_margin(spec.gain_crossover_rad_s, kMargins, kept + ", same crossover, nearest phase margin"));
  offer(search.nearest_crossover(-kSearchStep, kept + ", same phase margin, nearest crossover below"));
  offer(search.nearest_crossover(kSearchStep, kept + ", same phase margin, nearest crossover above"));
  if (designs.empty()) offer(search.nearest_of_all(kept + ", nearest crossover with any phase margin"));
  return designs;
}

std::vector<RelaxedOrder> relaxed_orders(const TuningDemand& demand, const TuningSpec& spec) {
  std::vector<RelaxedOrder> orders;
  const auto add = [&orders](double mu, const char* name) {
    if (mu >= kLowestMu && mu <= kHighestMu) orders.push_back({mu, name});
  };
  if (demand.theta_rad < 0 || demand.theta_rad >= pi) return orders;
  if (demand.theta_rad < kPracticalMu * pi / 2 && spec.mu != kPracticalMu)
    add(kPracticalMu, "iso-damping dropped, mu fixed at 0.9");
  const bool is_iso_damped = demand.phase_fall < largest_phase_fall(demand.theta_rad);
  if (is_iso_damped && spec.mu) {
    add(iso_damping_mu(demand), "mu left free: iso-damped");
  } else if (is_iso_damped) {
    add(1, "iso-damping dropped: the classical PD");
  } else if (demand.theta_rad < pi / 2 && spec.mu != 1) {
    add(1, "iso-damping dropped, flattest phase with mu up to 1: the classical PD");  // (4) rises with mu
  }
  if (!is_iso_damped && demand.theta_rad > 0) {
    add(iso_damping_mu(demand), "iso-damped with mu > 1: amplifies noise more than a derivative, not in the paper");
  }
  return orders;
}

std::vector<TunedController> relaxed_designs(const FractionalModel& plant, const TuningSpec& spec) {
  const PlantOnAxis on_axis{plant, spec.is_velocity_loop};
  const TuningDemand demand = tuning_demand(on_axis, std::log(spec.gain_crossover_rad_s), spec.phase_margin_deg);
  std::vector<TunedController> designs;
  for (const auto& [mu, name] : relaxed_orders(demand, spec)) {
    TuningSpec with_mu = spec;
    with_mu.mu = mu;
    auto design = tuned_controller(plant, with_mu, mu, name);
    if (design && is_sound(*design)) designs.push_back(std::move(*design));
  }
  return designs;
}

}  // namespace control
