// Solves (2) to (6) of tune.hpp.
#include "control/tuning/tuning_equations.hpp"

#include <cmath>
#include <limits>
#include <numbers>

namespace control {
namespace {

using std::numbers::pi;

constexpr double kNoPhaseRad = 1e-12;  // rounding: a phase margin that the plant has by itself

}  // namespace

TuningDemand tuning_demand(const PlantOnAxis& plant, double log_omega, double phase_margin_deg) {
  const AxisPoint p = plant.at(log_omega);
  const double theta_rad = phase_margin_deg * pi / 180 - pi - p.phase_rad;  // (2)
  return {log_omega, std::abs(theta_rad) < kNoPhaseRad ? 0 : theta_rad, -p.log_slope.imag(), p.log_magnitude};
}

double largest_phase_fall(double theta_rad) {
  return theta_rad > 0 && theta_rad < pi / 2 ? std::sin(2 * theta_rad) / 2 : 0;
}

ThetaRange feasible_theta(std::optional<double> mu, double phase_fall) {
  if (mu) return {0, *mu * pi / 2, true};
  if (phase_fall >= 0.5) return {};
  const double low_rad = std::asin(2 * phase_fall) / 2;
  return {low_rad, pi / 2 - low_rad, false};
}

double iso_damping_mu(const TuningDemand& demand) {
  const double sine = std::sin(demand.theta_rad), cosine = std::cos(demand.theta_rad);
  double low = 2 * demand.theta_rad / pi, high = 2;  // the left side of (4) rises from 0 to infinity between them
  while (true) {
    const double mu = (low + high) / 2;
    if (mu <= low || mu >= high) return mu;
    const double slope = mu * sine * (cosine - sine / std::tan(mu * pi / 2));  // (4), sin(q - θ) written out
    (slope < demand.phase_fall ? low : high) = mu;
  }
}

double derivative_part(double theta_rad, double mu) {
  const double divisor = std::sin(mu * pi / 2 - theta_rad);
  return divisor > 0 ? std::sin(theta_rad) / divisor : std::numeric_limits<double>::infinity();
}

std::optional<FopdController> controller_for(const TuningDemand& demand, double mu) {
  const double derivative = derivative_part(demand.theta_rad, mu);  // (3)
  if (!(derivative <= kLargestDerivative)) return std::nullopt;
  const double log_gain = std::log(std::abs(1.0 + std::polar(derivative, mu * pi / 2)));
  const double kp = std::exp(-log_gain - demand.log_plant_gain);    // (6)
  const double kd = derivative * std::exp(-mu * demand.log_omega);  // (3)
  if (!std::isnormal(kp) || !(kd == 0 || std::isnormal(kd))) return std::nullopt;
  return FopdController{kp, kd, mu};
}

}  // namespace control
