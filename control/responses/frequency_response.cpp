// Sums the powers of jω and differentiates them term by term.
#include "control/responses/frequency_response.hpp"

#include <cmath>
#include <numbers>

namespace control {
namespace {

using std::numbers::pi;

Complex direction(double order) { return std::polar(1.0, order * pi / 2); }  // j^order

// a/b in the plain way: the library's division looks for infinities that do not occur here, and takes its time.
Complex ratio(Complex a, Complex b) { return a * std::conj(b) / std::norm(b); }

}  // namespace

AxisPoint operator*(const AxisPoint& a, const AxisPoint& b) {
  return {a.value * b.value, a.log_magnitude + b.log_magnitude, a.phase_rad + b.phase_rad, a.log_slope + b.log_slope};
}

PlantOnAxis::PlantOnAxis(const FractionalModel& model, bool is_velocity_loop)
    : model_{model},
      alpha_direction_{direction(model.alpha)},
      beta_direction_{direction(model.beta)},
      log_gain_{std::log(std::abs(model.kp))},
      integrators_{is_velocity_loop ? 0.0 : 1.0},
      phase_at_0_rad_{-integrators_ * pi / 2 - (model.kp < 0 ? pi : 0)},
      dead_time_s_{model.dead_time_s} {}

AxisPoint PlantOnAxis::at(double log_omega) const {
  const Complex first = model_.b1 == 0 ? Complex{} : model_.b1 * std::exp(model_.alpha * log_omega) * alpha_direction_;
  const Complex second = model_.b2 * std::exp(model_.beta * log_omega) * beta_direction_;
  const Complex d = first + second + model_.b3;
  const Complex integrated = integrators_ == 0 ? d : d * Complex{0, std::exp(log_omega)};
  AxisPoint point{model_.kp * std::conj(integrated) / std::norm(integrated),               // (1)
                  log_gain_ - std::log(std::norm(d)) / 2 - integrators_ * log_omega,       //
                  phase_at_0_rad_ - std::arg(d),                                           //
                  -integrators_ - ratio(model_.alpha * first + model_.beta * second, d)};  // (3)
  if (dead_time_s_ > 0) {
    const double lag_rad = dead_time_s_ * std::exp(log_omega);  // (1a)
    point.value *= std::polar(1.0, -lag_rad);
    point.phase_rad -= lag_rad;
    point.log_slope -= Complex{0, lag_rad};
  }
  return point;
}

ControllerOnAxis::ControllerOnAxis(const FopdController& controller)
    : controller_{controller}, direction_{direction(controller.mu)}, log_gain_{std::log(controller.kp)} {}

AxisPoint ControllerOnAxis::at(double log_omega) const {
  if (controller_.kd == 0) return {controller_.kp, log_gain_, 0, 0};
  const Complex derivative = controller_.kd * std::exp(controller_.mu * log_omega) * direction_;
  const Complex c = 1.0 + derivative;
  return {controller_.kp * c, log_gain_ + std::log(std::norm(c)) / 2, std::arg(c),  // (2)
          ratio(controller_.mu * derivative, c)};                                   // (3)
}

}  // namespace control
