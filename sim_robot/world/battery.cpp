// Discharges the battery tick by tick.
#include "sim_robot/world/battery.hpp"

#include <algorithm>
#include <cmath>

#include "base/invalid_argument.hpp"
#include "sim_robot/world/tick.hpp"

namespace sim_robot {
namespace {

constexpr double kHourS = 3600;

void check_positive(const char* name, double value_mv) {
  if (!base::is_positive(value_mv)) {
    base::throw_invalid("battery: ", name, " must be positive and finite, is ", value_mv);
  }
}

}  // namespace

void check(const BatteryParameters& parameters) {
  check_positive("open_circuit_mv", parameters.open_circuit_mv);
  check_positive("nominal_mv", parameters.nominal_mv);
  base::check_not_negative("battery", "sag_mv", parameters.sag_mv);
  base::check_not_negative("battery", "idle_discharge_mv_h", parameters.idle_discharge_mv_h);
  base::check_not_negative("battery", "motor_discharge_mv_h", parameters.motor_discharge_mv_h);
}

Battery::Battery(const BatteryParameters& parameters)
    : open_circuit_mv_(parameters.open_circuit_mv),
      sag_mv_(parameters.sag_mv),
      per_nominal_mv_(1 / parameters.nominal_mv),
      idle_mv_(parameters.idle_discharge_mv_h * kTickS / kHourS),
      motor_mv_(parameters.motor_discharge_mv_h * kTickS / kHourS),
      supply_mv_(parameters.open_circuit_mv) {
  check(parameters);
}

void Battery::step(double duty) {
  const double used = std::abs(duty);
  open_circuit_mv_ = std::max(0.0, open_circuit_mv_ - idle_mv_ - motor_mv_ * used);  // (2)
  supply_mv_ = std::max(0.0, open_circuit_mv_ - sag_mv_ * used);                     // (1)
}

}  // namespace sim_robot
