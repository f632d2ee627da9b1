// Each parameter's sigma as a change of crossover and phase, then their sum with its correlations.
#include "control/tuning/margin_uncertainty.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "control/responses/frequency_response.hpp"

namespace control {
namespace {

using PerParameter = std::array<double, kParameters>;

// Without the sigmas.
std::array<Complex, kParameters> gradient_of_log(const FractionalModel& plant, double log_omega) {
  const Complex log_s{log_omega, std::numbers::pi / 2}, d = denominator(plant, log_s);
  const Complex first = std::exp(plant.alpha * log_s) / d, second = std::exp(plant.beta * log_s) / d;
  return {1 / plant.kp, -first, -second, -plant.b1 * first * log_s, -plant.b2 * second * log_s};  // (1)
}

double sd_of(const PerParameter& change, const ExpectedUncertainty& plant) {
  double variance = 0;
  for (std::size_t i = 0; i < kParameters; ++i) {
    for (std::size_t j = 0; j < kParameters; ++j) {
      variance += (i == j ? 1 : plant.correlation[i][j]) * change[i] * change[j];  // (3)
    }
  }
  return std::sqrt(std::max(variance, 0.0));
}

}  // namespace

MarginUncertainty margin_uncertainty(const OpenLoop& loop, double gain_crossover_rad_s,
                                     const ExpectedUncertainty& plant) {
  const double log_omega = std::log(gain_crossover_rad_s);
  const AxisPoint of_loop =
      PlantOnAxis{loop.plant, loop.is_velocity_loop}.at(log_omega) * ControllerOnAxis{loop.controller}.at(log_omega);
  const auto gradient = gradient_of_log(loop.plant, log_omega);
  PerParameter log_crossover{}, phase_rad{};
  for (std::size_t i = 0; i < kParameters; ++i) {
    const Complex change = gradient[i] * plant.one_sigma[i].value_or(0);
    log_crossover[i] = -change.real() / of_loop.log_slope.real();  // (2)
    phase_rad[i] = change.imag() + of_loop.log_slope.imag() * log_crossover[i];
  }
  const double of_dead_time_rad = gain_crossover_rad_s * plant.dead_time_sd_s;
  return {std::hypot(sd_of(phase_rad, plant), of_dead_time_rad) * kDegPerRad,
          sd_of(log_crossover, plant) * gain_crossover_rad_s};
}

}  // namespace control
