// Finds the pole, lays the ray, and weighs the exponentials.
#include "control/modal_form.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <stdexcept>

namespace control {
namespace {

using std::numbers::pi;

constexpr double kNearestToCutRad = 1e-9;
constexpr double kLargestLogRate = 650;  // e^650 is still a number

void check(const ModalRange& range) {
  std::ostringstream text;
  if (!(range.shortest_s > 0 && std::isfinite(range.shortest_s))) {
    text << "modal form: shortest_s must be positive, is " << range.shortest_s;
  } else if (!(range.longest_s > range.shortest_s && std::isfinite(range.longest_s))) {
    text << "modal form: longest_s must be above shortest_s, is " << range.longest_s;
  } else if (!(range.tolerance >= 1e-14 && range.tolerance <= 0.1)) {
    text << "modal form: tolerance must lie in [1e-14, 0.1], is " << range.tolerance;
  } else {
    return;
  }
  throw std::invalid_argument(text.str());
}

// On each ray of angle φ in (π/α, π) there is one radius where Im D = 0; ln s there.
Complex where_imaginary_part_vanishes(const FractionalModel& model, double angle_rad) {
  const double log_ratio =
      std::log(model.b2 * std::sin(model.beta * angle_rad)) - std::log(-model.b1 * std::sin(model.alpha * angle_rad));
  return {log_ratio / (model.alpha - model.beta), angle_rad};
}

bool is_outside(const FractionalModel& model, double angle_rad) {
  return denominator(model, where_imaginary_part_vanishes(model, angle_rad)).real() < 0;
}

double magnitude(const FractionalModel& model, double log_frequency) {
  return std::abs(denominator(model, {log_frequency, pi / 2}));
}

}  // namespace

std::optional<Complex> log_pole(const FractionalModel& model) {
  if (model.b1 == 0 || model.alpha <= 1) return std::nullopt;
  double low = pi / model.alpha * (1 + 1e-12), high = pi - kNearestToCutRad;
  if (low >= high || is_outside(model, high)) return std::nullopt;
  for (int halving = 0; halving < 60; ++halving) {
    const double middle = (low + high) / 2;
    (is_outside(model, middle) ? low : high) = middle;
  }
  Complex log_p = where_imaginary_part_vanishes(model, high);
  for (int i = 0; i < 3; ++i) {  // Newton in ln s
    log_p -= denominator(model, log_p) / (denominator_slope(model, log_p) * std::exp(log_p));
  }
  return log_p;
}

Ray choose_ray(const FractionalModel& model, const ModalRange& range) {
  const std::optional<Complex> pole = log_pole(model);
  const double pole_angle_rad = pole ? pole->imag() : pi;
  double low = pi / 2, high = pole_angle_rad;
  if (pi - pole_angle_rad > high - low) low = pole_angle_rad, high = pi;

  Ray ray;
  ray.angle_rad = (low + high) / 2;
  double highest = -std::log(range.shortest_s);
  const double growth = std::max(magnitude(model, highest) / model.b3, 1.0);  // of the response after shortest_s
  ray.log_step = pi * (high - low) / std::log(10 * growth / range.tolerance);

  // Up to where H has become small against its value at 1/shortest_s.
  const double enough = magnitude(model, highest) / range.tolerance;
  while (highest < kLargestLogRate && magnitude(model, highest) < enough) highest += ray.log_step;
  ray.slow_rate = std::exp(highest) * range.tolerance / growth;  // (4): a/s is as small as H there

  // Down to where H - H(0) a/(s + a) has become small, or so slow that nothing of it is seen by longest_s.
  const double constant = std::log(range.tolerance * model.b3 / model.b2) / model.beta;
  const double slow = std::log(range.tolerance) / (1 + model.beta) - std::log(range.longest_s);
  const double slow_rate = (std::log(range.tolerance * ray.slow_rate) - std::log(range.longest_s)) / 2;
  ray.first_log_rate = std::min(std::max(constant, slow), slow_rate);
  ray.count = 1 + static_cast<int>(std::ceil((highest - ray.first_log_rate) / ray.log_step));
  return ray;
}

ModalForm modal_form(const FractionalModel& model, const ModalRange& range) {
  check(model);
  check(range);
  const Ray ray = choose_ray(model, range);
  const double gain = model.kp / model.b3;
  ModalForm form;
  for (int i = 0; i < ray.count; ++i) {
    const Complex log_s{ray.first_log_rate + i * ray.log_step, ray.angle_rad}, s = std::exp(log_s);
    form.rate.push_back(s);
    const Complex rest = model.kp / denominator(model, log_s) - gain * ray.slow_rate / (s + ray.slow_rate);  // (4)
    form.weight.push_back(ray.log_step / Complex{0, 2 * pi} * rest * s);                                     // (2)
  }
  form.rate.push_back(-ray.slow_rate);
  form.weight.push_back(gain * ray.slow_rate / 2);
  const std::optional<Complex> pole = log_pole(model);
  if (pole && pole->imag() < ray.angle_rad) {
    form.rate.push_back(std::exp(*pole));
    form.weight.push_back(model.kp / denominator_slope(model, *pole));  // (3)
  }
  return form;
}

}  // namespace control
