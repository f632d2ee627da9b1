// Compares frequency responses.
#include "control/discretisation/discretisation_errors.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace control {
namespace {

using std::numbers::pi;

constexpr int kFrequencies = 200;

}  // namespace

std::vector<double> error_frequencies(double period_s, double loop_bandwidth_rad_s) {
  const double high = 0.8 * pi / period_s;
  const double low = std::min({0.1, loop_bandwidth_rad_s / 300, high / 300});
  std::vector<double> omega_rad_s;
  for (int i = 0; i < kFrequencies; ++i) {
    omega_rad_s.push_back(low * std::pow(high / low, static_cast<double>(i) / (kFrequencies - 1)));
  }
  return omega_rad_s;
}

DiscretisationErrors measure_errors(const ParallelSections& sections, double period_s, const FopdController& controller,
                                    double loop_bandwidth_rad_s) {
  const std::vector<double> omega_rad_s = error_frequencies(period_s, loop_bandwidth_rad_s);
  DiscretisationErrors errors;
  errors.band_low_rad_s = omega_rad_s.front();
  errors.band_high_rad_s = omega_rad_s.back();
  errors.bandwidth_rad_s = std::min(loop_bandwidth_rad_s, omega_rad_s.back());
  double sum = 0;
  for (const double omega : omega_rad_s) {
    const Complex ratio =
        discrete_response(sections, period_s, omega) / controller_transfer(controller, Complex(0, omega));
    const double relative = std::abs(ratio - 1.0), deg = std::abs(std::arg(ratio)) * 180 / pi;
    errors.max_db = std::max(errors.max_db, std::abs(20 * std::log10(std::abs(ratio))));
    errors.max_deg = std::max(errors.max_deg, deg);
    sum += relative * relative;
    if (omega > errors.bandwidth_rad_s) continue;
    errors.max_relative_in_bandwidth = std::max(errors.max_relative_in_bandwidth, relative);
    errors.max_deg_in_bandwidth = std::max(errors.max_deg_in_bandwidth, deg);
  }
  errors.rms_relative = std::sqrt(sum / kFrequencies);
  return errors;
}

Complex generating_function(const FopdController& controller, double a, double period_s, Complex z) {
  const Complex delay = 1.0 / z, s = (1 + a) / period_s * (1.0 - delay) / (1.0 + a * delay);
  if (s == 0.0) return controller.kp;
  return controller_transfer(controller, s);
}

double max_fit_error(const ParallelSections& sections, double period_s, const FopdController& controller, double a,
                     const std::vector<double>& omega_rad_s) {
  double largest = 0;
  for (const double omega : omega_rad_s) {
    const Complex exact = generating_function(controller, a, period_s, std::polar(1.0, omega * period_s));
    largest = std::max(largest, std::abs(discrete_response(sections, period_s, omega) / exact - 1.0));
  }
  return largest;
}

}  // namespace control
