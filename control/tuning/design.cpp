// Judges a design by the margins it achieves.
#include "control/tuning/design.hpp"

#include <cmath>
#include <sstream>

namespace control {
namespace {

constexpr double kSameCrossover = 1e-6;  // relative

}  // namespace

std::string remark_on(const FopdController& controller, double gain_crossover_rad_s) {
  const double derivative = controller.kd * std::pow(gain_crossover_rad_s, controller.mu);
  if (!(derivative > kMuchDerivative)) return {};
  std::ostringstream text;
  text.precision(3);
  text << "kd omega^mu is " << derivative << " at the crossover, above " << kMuchDerivative
       << ": nearly all of it is derivative, and errors that stay are corrected slowly";
  return text.str();
}

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
