// One sum.
#include "control/sensor/position_weight.hpp"

#include <cmath>

namespace control {

double sd_of_mean_weight(std::span<const double> sd_m) {
  double sum = 0;
  for (const double sd : sd_m) sum += 1 / (sd * sd);
  return std::sqrt(static_cast<double>(sd_m.size()) / sum);
}

}  // namespace control
