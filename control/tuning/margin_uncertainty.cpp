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

// (1) without the sigmas, and (1)' of (4).
struct Gradient {
  std::array<Complex, kParameters> value, slope;
};

Gradient gradient_of_log(const FractionalModel& plant, double log_omega) {
  const auto& [kp, b1, b2, b3, alpha, beta, dead_time_s] = plant;
  const Complex log_s{log_omega, std::numbers::pi / 2}, d = denominator(plant, log_s);
  const Complex first = std::exp(alpha * log_s) / d, second = std::exp(beta * log_s) / d;
  const Complex of_d = b1 * alpha * first + b2 * beta * second;  // d ln D/d ln ω
  const Complex first_slope = alpha - of_d, second_slope = beta - of_d;
  return {{1 / kp, -first, -second, -b1 * first * log_s, -b2 * second * log_s},
          {0, -first * first_slope, -second * second_slope, -b1 * first * (first_slope * log_s + 1.0),
           -b2 * second * (second_slope * log_s + 1.0)}};
}

// S' of (4).
Complex bend_of(const OpenLoop& loop, double log_omega) {
  const auto& [kp, b1, b2, b3, alpha, beta, dead_time_s] = loop.plant;
  const Complex log_s{log_omega, std::numbers::pi / 2}, d = denominator(loop.plant, log_s);
  const Complex first = b1 * std::exp(alpha * log_s) / d, second = b2 * std::exp(beta * log_s) / d;
  const Complex of_d = alpha * first + beta * second;
  const Complex of_plant = of_d * of_d - alpha * alpha * first - beta * beta * second;
  const double mu = loop.controller.mu;
  const Complex derivative = loop.controller.kd * std::exp(mu * log_s);
  const Complex of_controller = mu * mu * derivative / ((1.0 + derivative) * (1.0 + derivative));
  return of_plant + of_controller - Complex{0, std::exp(log_omega) * dead_time_s};
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
  const Gradient gradient = gradient_of_log(loop.plant, log_omega);
  const double by_crossover_rad = bend_of(loop, log_omega).imag() - of_loop.log_slope.imag();
  PerParameter log_crossover{}, phase_rad{}, slope_s{};
  for (std::size_t i = 0; i < kParameters; ++i) {
    const double sigma = plant.one_sigma[i].value_or(0);
    const Complex change = gradient.value[i] * sigma;
    log_crossover[i] = -change.real() / of_loop.log_slope.real();  // (2)
    phase_rad[i] = change.imag() + of_loop.log_slope.imag() * log_crossover[i];
    const double slope_rad = gradient.slope[i].imag() * sigma + by_crossover_rad * log_crossover[i];
    slope_s[i] = slope_rad / gain_crossover_rad_s;  // (4)
  }
  const double of_dead_time_rad = gain_crossover_rad_s * plant.dead_time_sd_s;
  return {std::hypot(sd_of(phase_rad, plant), of_dead_time_rad) * kDegPerRad,
          sd_of(log_crossover, plant) * gain_crossover_rad_s,
          std::hypot(sd_of(slope_s, plant), plant.dead_time_sd_s) * kDegPerRad};
}

}  // namespace control
