// Crossover by crossover, the phase margins that have a sound iso-damped design: the data of a map of what can be asked
// for.
//
// Crossovers are spaced logarithmically, both ends included. The margins of each are those of sound_phase_margins, with
// its accuracy. Where there is none, the map says which condition excludes them all:
//   phase_falls_too_fast   R ≥ 1/2 in (5) of tune.hpp: no fractional PD with mu below 1 makes the phase flat there
//   margin_below_0         (5) has solutions, with phase margins below 0 only: every such loop is unstable
//   margin_above_180       (5) has solutions, with phase margins above 180° only
//   not_sound              of the designs that were tried, each is unstable, or another crossover has a smaller margin
// Errors: throws std::invalid_argument quoting the bad value.
#pragma once

#include <functional>
#include <vector>

#include "control/tuning/feasible_margins.hpp"

namespace control {

enum class MapReason { feasible, phase_falls_too_fast, margin_below_0, margin_above_180, not_sound };

struct TuningMapSpec {
  double from_rad_s = 0.5;
  double to_rad_s = 50;  // above from_rad_s
  int points = 60;       // 2 to kMostMapPoints
  bool is_velocity_loop = false;
  double period_s = 0;  // as in TuningSpec
};

inline constexpr int kMostMapPoints = 500;

struct TuningMapPoint {
  double gain_crossover_rad_s = 0;
  MapReason reason = MapReason::feasible;
  double phase_fall = 0;                 // R
  std::vector<PhaseMarginRange> ranges;  // ascending; empty unless feasible
};

// `goes_on` is asked before each point, with the share that is done; the map ends where it says false.
std::vector<TuningMapPoint> tuning_map(const FractionalModel& plant, const TuningMapSpec& spec,
                                       const std::function<bool(double share)>& goes_on = {});

}  // namespace control
