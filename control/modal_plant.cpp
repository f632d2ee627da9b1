// Finds the modes of the model and advances them.
#include "control/modal_plant.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <stdexcept>

namespace control {
namespace {

using Complex = std::complex<double>;
using std::numbers::pi;

constexpr double kLowestLogRate = -10, kHighestLogRate = 12;  // of (4), rates in 1/s
constexpr double kLargestLogStep = 0.12;
constexpr double kSmallestPoleDistanceRad = 0.02;  // from the cut; nearer poles would need thousands of modes

[[noreturn]] void refuse(const char* what, double value) {
  std::ostringstream text;
  text << "fractional model: " << what << ' ' << value;
  throw std::invalid_argument(text.str());
}

void check_range(const FractionalModel& model, double dt_s) {
  if (!std::isfinite(model.kp)) refuse("gain must be finite, is", model.kp);
  if (!(model.b1 > 0 && std::isfinite(model.b1))) refuse("b1 must be positive, is", model.b1);
  if (!(model.b2 > 0 && std::isfinite(model.b2))) refuse("b2 must be positive, is", model.b2);
  if (!(model.b3 > 0 && std::isfinite(model.b3))) refuse("b3 must be positive, is", model.b3);
  if (!(dt_s > 0 && std::isfinite(dt_s))) refuse("dt_s must be positive, is", dt_s);
  if (model.alpha == 2 && model.beta == 1) return;
  if (!(model.alpha > 1 && model.alpha < 2)) refuse("alpha must lie in (1, 2), or be 2 with beta 1, is", model.alpha);
  if (!(model.beta > 0 && model.beta < 1)) refuse("beta must lie in (0, 1), or be 1 with alpha 2, is", model.beta);
}

Complex denominator(const FractionalModel& model, Complex log_s) {
  return model.b1 * std::exp(model.alpha * log_s) + model.b2 * std::exp(model.beta * log_s) + model.b3;
}

Complex denominator_slope(const FractionalModel& model, Complex log_s) {
  return model.alpha * model.b1 * std::exp((model.alpha - 1) * log_s) +
         model.beta * model.b2 * std::exp((model.beta - 1) * log_s);
}

// On each ray of angle θ in (π/α, 2π/α) there is one radius where Im D = 0; the poles are where Re D is 0 there too.
struct Ray {
  double log_radius;
  double real_part;
};

Ray along(const FractionalModel& model, double angle_rad) {
  const double sine = std::sin(model.alpha * angle_rad);
  const double ratio = -model.b2 * std::sin(model.beta * angle_rad) / (model.b1 * sine);
  const double log_radius = std::log(ratio) / (model.alpha - model.beta);
  return {log_radius, denominator(model, {log_radius, angle_rad}).real()};
}

// ln s of every pole with an angle in (0, 2π), so on the principal sheet and on the next one.
std::vector<Complex> log_poles(const FractionalModel& model) {
  constexpr int kRays = 2000;
  const double first = pi / model.alpha, last = std::min(2 * pi / model.alpha, pi / model.beta);
  const double spacing = (last - first) / kRays;
  std::vector<Complex> found;
  for (int i = 1; i < kRays - 1; ++i) {
    double low = first + i * spacing, high = low + spacing;
    const bool rises = along(model, low).real_part < 0;
    if (rises == (along(model, high).real_part < 0)) continue;
    for (int halving = 0; halving < 60; ++halving) {
      const double middle = (low + high) / 2;
      ((along(model, middle).real_part < 0) == rises ? low : high) = middle;
    }
    found.emplace_back(along(model, low).log_radius, low);
  }
  return found;
}

// Integrals of e^{at} over a step: φ1 = (e^{z} - 1)/z and φ2 = (e^{z} - 1 - z)/z², z = a·dt, without cancellation.
template <class Number>
std::pair<Number, Number> phi(Number z) {
  if (std::abs(z) < 0.02) {
    const Number phi2 = 0.5 + z * (1.0 / 6 + z * (1.0 / 24 + z * (1.0 / 120 + z * (1.0 / 720 + z / 5040.0))));
    return {1.0 + z * phi2, phi2};
  }
  const Number phi1 = (std::exp(z) - 1.0) / z;
  return {phi1, (phi1 - 1.0) / z};
}

}  // namespace

ModalPlant::ModalPlant(const FractionalModel& model, double dt_s) : dt_s_(dt_s) {
  check_range(model, dt_s);
  if (model.alpha == 2) {
    add_integer_order_modes(model);
  } else {
    add_fractional_order_modes(model);
  }
}

void ModalPlant::add_real_mode(double rate, double weight) {
  const auto [phi1, phi2] = phi(-rate * dt_s_);
  real_modes_.push_back(
      {rate, weight, std::exp(-rate * dt_s_), weight * dt_s_ * phi1, dt_s_ * phi1, weight * dt_s_ * dt_s_ * phi2, 0});
}

void ModalPlant::add_complex_mode(Complex pole, Complex residue) {
  const auto [phi1, phi2] = phi(pole * dt_s_);
  complex_modes_.push_back(
      {pole, residue, std::exp(pole * dt_s_), residue * dt_s_ * phi1, dt_s_ * phi1, residue * dt_s_ * dt_s_ * phi2, 0});
}

void ModalPlant::add_integer_order_modes(const FractionalModel& model) {
  const double half = model.b2 / (2 * model.b1), square = half * half - model.b3 / model.b1;
  if (square == 0) refuse("a double pole is not supported, b2^2 - 4 b1 b3 is", square);
  const Complex root = std::sqrt(Complex{square, 0});
  const Complex residue = model.kp / (2 * model.b1 * root);
  if (square < 0) return add_complex_mode(-half + root, residue);
  add_real_mode(half - root.real(), residue.real());
  add_real_mode(half + root.real(), -residue.real());
}

void ModalPlant::add_fractional_order_modes(const FractionalModel& model) {
  double distance_rad = pi / 2;  // of the nearest pole from the cut; the trapezoid errs by exp(-2π distance/h)
  for (const Complex log_pole : log_poles(model)) {
    const double angle_rad = log_pole.imag();
    distance_rad = std::min(distance_rad, std::abs(angle_rad - pi));
    if (angle_rad > pi) continue;
    add_complex_mode(std::exp(log_pole), model.kp / denominator_slope(model, log_pole));  // (3)
  }
  if (distance_rad < kSmallestPoleDistanceRad) {
    refuse("the nearest pole must keep 0.02 rad from the negative axis, its distance is", distance_rad);
  }
  const double wanted_step = std::min(kLargestLogStep, distance_rad * 2 * pi / std::log(1e8));
  const int count = static_cast<int>(std::ceil((kHighestLogRate - kLowestLogRate) / wanted_step));
  const double log_step = (kHighestLogRate - kLowestLogRate) / count;
  for (int i = 0; i <= count; ++i) {
    const double log_rate = kLowestLogRate + i * log_step;
    const Complex response = model.kp / denominator(model, {log_rate, pi});
    const double rate = std::exp(log_rate);
    add_real_mode(rate, -log_step * rate * response.imag() / pi);  // (3), (4)
  }
}

void ModalPlant::step(double duty) {
  double moved_m = 0, velocity_m_s = 0;
  for (RealMode& mode : real_modes_) {
    moved_m += mode.position * mode.state + mode.position_input * duty;
    mode.state = mode.decay * mode.state + mode.input * duty;
    velocity_m_s += mode.state;
  }
  for (ComplexMode& mode : complex_modes_) {
    moved_m += 2 * (mode.position * mode.state + mode.position_input * duty).real();
    mode.state = mode.decay * mode.state + mode.input * duty;
    velocity_m_s += 2 * mode.state.real();
  }
  duty_ = duty;
  position_m_ += moved_m;
  velocity_m_s_ = velocity_m_s;
}

double ModalPlant::acceleration_m_s2() const {
  double sum = 0;
  for (const RealMode& mode : real_modes_) sum += mode.weight * duty_ - mode.rate * mode.state;
  for (const ComplexMode& mode : complex_modes_) sum += 2 * (mode.weight * duty_ + mode.pole * mode.state).real();
  return sum;
}

void ModalPlant::reset() {
  for (RealMode& mode : real_modes_) mode.state = 0;
  for (ComplexMode& mode : complex_modes_) mode.state = 0;
  duty_ = position_m_ = velocity_m_s_ = 0;
}

}  // namespace control
