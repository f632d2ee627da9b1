// Judges a design by the margins it achieves.
#include "control/tuning/design.hpp"

#include <cmath>

namespace control {
namespace {

constexpr double kSameCrossover = 1e-6;  // relative

}  // namespace

FractionalModel with_hold(FractionalModel plant, double period_s) {
  plant.dead_time_s += period_s / 2;
  return plant;
}

bool is_ruled_elsewhere(const TunedController& design) {
  const double asked = design.spec.gain_crossover_rad_s;
  const double ruling = design.achieved.gain_crossover_rad_s.value_or(asked);
  return std::abs(ruling / asked - 1) > kSameCrossover;
}

bool is_sound(const TunedController& design) {
  return design.achieved.is_closed_loop_stable && design.sampled.is_closed_loop_stable && !is_ruled_elsewhere(design);
}

}  // namespace control
