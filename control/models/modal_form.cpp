// Finds the pole, lays the ray, and weighs the exponentials.
#include "control/models/modal_form.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/invalid_argument.hpp"

namespace control {
namespace {

using std::numbers::pi;

constexpr double kNearestToCutRad = 1e-7;    // nearer, a pole equals a double one on the cut numerically
constexpr double kNearestToUndamped = 1e-9;  // relative to π/α; nearer, sin αφ has too few digits to bisect by
constexpr double kFastestLogRate = 40;       // of a mode, against 1/shortest_s; still faster ones follow at once
constexpr double kLargestGrowth = 1e20;
constexpr double kLargestPoleLogRate = 200;  // faster and slower poles are beyond any time of interest
constexpr double kLargestLogRate = 4e4;      // where those are given up: enough for beta = 0.001

void check(const ModalRange& range) {
  if (!(range.shortest_s > 0 && std::isfinite(range.shortest_s))) {
    base::throw_invalid("modal form: shortest_s must be positive, is ", range.shortest_s);
  }
  if (!(range.longest_s > range.shortest_s && std::isfinite(range.longest_s))) {
    base::throw_invalid("modal form: longest_s must be above shortest_s, is ", range.longest_s);
  }
  if (!(range.tolerance >= 1e-14 && range.tolerance <= 0.1)) {
    base::throw_invalid("modal form: tolerance must lie in [1e-14, 0.1], is ", range.tolerance);
  }
}

// On each ray of angle φ in (π/α, π) there is one radius where Im D = 0; ln s there.
Complex where_imaginary_part_vanishes(const FractionalModel& model, double angle_rad) {
  const double log_ratio =
      std::log(model.b2 * std::sin(model.beta * angle_rad)) - std::log(-model.b1 * std::sin(model.alpha * angle_rad));
  return {log_ratio / (model.alpha - model.beta), angle_rad};
}

// Whether Re D < 0 there. With Im D = 0 it is b3 + b2 r^β sin((α - β)φ)/sin(αφ), whose terms may be beyond a double.
bool is_outside(const FractionalModel& model, double angle_rad) {
  const double sine = std::sin((model.alpha - model.beta) * angle_rad);
  if (sine <= 0) return false;
  const double log_radius = where_imaginary_part_vanishes(model, angle_rad).real();
  return std::log(model.b2 * sine) + model.beta * log_radius > std::log(-model.b3 * std::sin(model.alpha * angle_rad));
}

double magnitude(const FractionalModel& model, double log_frequency) {
  return std::abs(denominator(model, {log_frequency, pi / 2}));
}

// How much more the velocity of a step is in the end than at t, about; beyond what rounding leaves it does not matter.
double growth_after(const FractionalModel& model, double t) {
  return std::clamp(magnitude(model, -std::log(t)) / model.b3, 1.0, kLargestGrowth);
}

// A mode of rate x adds x t |H(x) - H(0) a/(x + a)|/H(0) to a response that has come to b3/|D(1/t)|: ln x where that is
// the tolerance. The difference is at most 1, and below the sum of b1/b3 x^α, b2/b3 x^β and x/a.
double lowest_log_rate(const FractionalModel& model, double slow_rate, double t, double tolerance) {
  const double growth = growth_after(model, t);
  const double allowed = std::log(tolerance / growth) - std::log(t);
  double lowest = (allowed + std::log(slow_rate)) / 2;
  lowest = std::min(lowest, (allowed - std::log(model.b2 / model.b3)) / (1 + model.beta));
  if (model.b1 > 0) lowest = std::min(lowest, (allowed - std::log(model.b1 / model.b3)) / (1 + model.alpha));
  return std::max(lowest, allowed);
}

// What the rates of (2) above the last one do to a response that is older than they are: -2 Re Σ w/s.
double follows_at_once(const FractionalModel& model, const Ray& ray, double tolerance) {
  double sum = 0;
  Complex log_s{ray.first_log_rate + ray.count * ray.log_step, ray.angle_rad};
  const double gain = model.kp / model.b3, slow_rate_log = std::log(ray.slow_rate);
  for (; log_s.real() < kLargestLogRate; log_s += ray.log_step) {
    const Complex response = model.kp / denominator(model, log_s);
    if (std::abs(response) < tolerance * std::abs(gain)) break;
    sum -= ray.log_step / pi * (response - gain * std::exp(slow_rate_log - log_s)).imag();
  }
  return sum;
}

}  // namespace

std::optional<Complex> log_pole(const FractionalModel& model) {
  if (model.b1 == 0 || model.alpha <= 1) return std::nullopt;
  double low = pi / model.alpha * (1 + kNearestToUndamped), high = pi - kNearestToCutRad;
  if (low >= high || is_outside(model, high)) return std::nullopt;
  Complex log_p{std::log(model.b3 / model.b1) / model.alpha, pi / model.alpha};  // without b2
  if (is_outside(model, low)) {
    for (int halving = 0; halving < 60; ++halving) {
      const double middle = (low + high) / 2;
      (is_outside(model, middle) ? low : high) = middle;
    }
    log_p = where_imaginary_part_vanishes(model, high);
  }
  for (int i = 0; i < 3; ++i) {  // Newton in ln s
    const Complex correction = denominator(model, log_p) / (denominator_slope(model, log_p) * std::exp(log_p));
    if (!(std::abs(correction) < 1e-3)) break;  // at magnitudes beyond a double the bisection must do
    log_p -= correction;
  }
  log_p.imag(std::max(log_p.imag(), std::nextafter(pi / model.alpha, pi)));  // where rounding would make it grow
  return log_p;
}

std::optional<PolePair> pole_pair(const FractionalModel& model, double largest_angle_rad) {
  const std::optional<Complex> log_p = log_pole(model);
  if (!log_p || log_p->imag() >= largest_angle_rad || std::abs(log_p->real()) > kLargestPoleLogRate)
    return std::nullopt;
  return PolePair{std::exp(*log_p), model.kp / denominator_slope(model, *log_p)};  // (3)
}

Ray choose_ray(const FractionalModel& model, const ModalRange& range) {
  const std::optional<Complex> pole = log_pole(model);
  const double pole_angle_rad = pole ? pole->imag() : pi;
  double low = pi / 2, high = pole_angle_rad;
  if (pi - pole_angle_rad > high - low) low = pole_angle_rad, high = pi;

  Ray ray;
  ray.angle_rad = (low + high) / 2;
  double highest = -std::log(range.shortest_s);
  const double growth = growth_after(model, range.shortest_s);
  ray.log_step = pi * (high - low) / std::log(20 * growth / range.tolerance);

  // Up to where H has become small against its value at 1/shortest_s.
  const double enough = magnitude(model, highest) / range.tolerance, fastest = highest + kFastestLogRate;
  while (highest < fastest && magnitude(model, highest) < enough) highest += ray.log_step;
  ray.growth = growth;
  ray.slow_rate = std::exp(highest) * range.tolerance / growth;  // (4): a/s is as small as H there

  // Down to where nothing is seen by longest_s, of a response that may still be growing then.
  const double slowest = lowest_log_rate(model, ray.slow_rate, range.shortest_s, range.tolerance);
  ray.first_log_rate = std::min(slowest, lowest_log_rate(model, ray.slow_rate, range.longest_s, range.tolerance));
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
  const double fastest = std::abs(form.rate.back());
  form.rate.push_back(-fastest);
  form.weight.push_back(follows_at_once(model, ray, 0.01 * range.tolerance / ray.growth) * fastest / 2);
  form.rate.push_back(-ray.slow_rate);
  form.weight.push_back(gain * ray.slow_rate / 2);
  if (const std::optional<PolePair> pair = pole_pair(model, ray.angle_rad)) {
    form.rate.push_back(pair->pole);
    form.weight.push_back(pair->residue);
  }
  return form;
}

// The series where the differences of (5) would cancel.
StepFactors step_factors(Complex rate, double dt_s) {
  const Complex z = rate * dt_s, decay = std::exp(z);
  if (std::abs(z) >= 0.5) {
    const Complex first = (decay - 1.0) / z;
    return {decay, dt_s * first, dt_s * dt_s * ((first - 1.0) / z)};
  }
  Complex second = 0;
  for (int n = 16; n >= 2; --n) second = (1.0 + second * z) / static_cast<double>(n);  // Σ z^k/(k + 2)!
  return {decay, dt_s * (1.0 + z * second), dt_s * dt_s * second};
}

}  // namespace control
