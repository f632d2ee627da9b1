// Steps the motor's lag exactly.
#include "sim_robot/world/motor.hpp"

#include <cmath>

#include "base/invalid_argument.hpp"
#include "sim_robot/world/tick.hpp"

namespace sim_robot {

void check(const MotorParameters& parameters) {
  if (!(parameters.dead_zone_duty >= 0 && parameters.dead_zone_duty < 1)) {
    base::throw_invalid("motor: dead_zone_duty must be in [0, 1), is ", parameters.dead_zone_duty);
  }
  if (!(parameters.time_constant_s >= 0 && parameters.time_constant_s <= 10)) {
    base::throw_invalid("motor: time_constant_s must be in [0, 10], is ", parameters.time_constant_s);
  }
}

Motor::Motor(const MotorParameters& parameters)
    : dead_zone_duty_(parameters.dead_zone_duty),
      direction_(parameters.is_reversed ? -1 : 1),
      decay_(std::exp(-kTickS / parameters.time_constant_s)),
      mean_share_(parameters.time_constant_s / kTickS * (1 - decay_)) {
  check(parameters);
}

double Motor::step(double duty, double supply_ratio) {
  const double wanted = direction_ * driven(duty) * supply_ratio;  // (1)
  const double mean = wanted + (rate_ - wanted) * mean_share_;     // (3)
  rate_ = wanted + (rate_ - wanted) * decay_;                      // (2)
  return mean;
}

}  // namespace sim_robot
