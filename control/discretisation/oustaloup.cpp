// Residues in s, then one section each in z.
#include "control/discretisation/oustaloup.hpp"

#include <cmath>

namespace control {

ParallelSections oustaloup_tustin(const FopdController& controller, const OustaloupBand& band, int order,
                                  double period_s) {
  const auto count = static_cast<std::size_t>(order);
  std::vector<double> zero(count), pole(count);  // ω', ω of (1)
  for (std::size_t k = 0; k < count; ++k) {
    const double middle = 2 * static_cast<double>(k) + 1, ratio = band.high_rad_s / band.low_rad_s;
    zero[k] = band.low_rad_s * std::pow(ratio, (middle - controller.mu) / (2 * order));
    pole[k] = band.low_rad_s * std::pow(ratio, (middle + controller.mu) / (2 * order));
  }
  const double gain = controller.kp * controller.kd * std::pow(band.high_rad_s, controller.mu), c = 2 / period_s;
  ParallelSections sections;
  sections.direct = controller.kp + gain;
  for (std::size_t k = 0; k < count; ++k) {
    double residue = zero[k] - pole[k];  // (2)
    for (std::size_t j = 0; j < count; ++j) residue *= j == k ? 1 : (zero[j] - pole[k]) / (pole[j] - pole[k]);
    const double b = gain * residue / (c + pole[k]);  // (3)
    add_first_order(sections, b, b, (c - pole[k]) / (c + pole[k]));
  }
  return sections;
}

}  // namespace control
