// Each point by sound_phase_margins, and where it finds none, why.
#include "control/tuning/tuning_map.hpp"

#include <cmath>

#include "base/invalid_argument.hpp"
#include "control/tuning/tuning_alternatives.hpp"
#include "control/tuning/tuning_equations.hpp"

namespace control {
namespace {

void check(const TuningMapSpec& spec) {
  check_crossover(spec.from_rad_s);
  check_crossover(spec.to_rad_s);
  if (!(spec.to_rad_s > spec.from_rad_s)) {
    base::throw_invalid("tuning map: to_rad_s must be above from_rad_s, ", spec.from_rad_s, ", is ", spec.to_rad_s);
  }
  if (spec.points < 2 || spec.points > kMostMapPoints) {
    base::throw_invalid("tuning map: points must lie in 2 to ", kMostMapPoints, ", is ", spec.points);
  }
}

double crossover_of(const TuningMapSpec& spec, int index) {
  if (index == spec.points - 1) return spec.to_rad_s;
  return spec.from_rad_s * std::pow(spec.to_rad_s / spec.from_rad_s, static_cast<double>(index) / (spec.points - 1));
}

// Of a crossover without any range.
MapReason why_none(const std::optional<PhaseMarginRange>& solved) {
  if (!solved) return MapReason::phase_falls_too_fast;
  if (solved->high_deg <= 0) return MapReason::margin_below_0;
  return solved->low_deg >= 180 ? MapReason::margin_above_180 : MapReason::not_sound;
}

TuningMapPoint point_at(const FractionalModel& plant, double omega_rad_s, const TuningMapSpec& of_map) {
  const bool is_velocity_loop = of_map.is_velocity_loop;
  TuningSpec spec;
  spec.gain_crossover_rad_s = omega_rad_s;
  spec.is_velocity_loop = is_velocity_loop;
  spec.period_s = of_map.period_s;
  TuningMapPoint point;
  point.gain_crossover_rad_s = omega_rad_s;
  point.phase_fall = tuning_demand(PlantOnAxis{plant, is_velocity_loop}, std::log(omega_rad_s), 0).phase_fall;
  point.ranges = sound_phase_margins(plant, spec);
  if (point.ranges.empty()) point.reason = why_none(feasible_phase_margins(plant, omega_rad_s, is_velocity_loop));
  return point;
}

}  // namespace

std::vector<TuningMapPoint> tuning_map(const FractionalModel& plant, const TuningMapSpec& spec,
                                       const std::function<bool(double share)>& goes_on) {
  check_tuned_plant(plant);
  check(spec);
  std::vector<TuningMapPoint> map;
  for (int i = 0; i < spec.points; ++i) {
    if (goes_on && !goes_on(static_cast<double>(i) / spec.points)) break;
    map.push_back(point_at(plant, crossover_of(spec, i), spec));
  }
  return map;
}

}  // namespace control
