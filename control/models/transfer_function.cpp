// Powers by way of the logarithm.
#include "control/models/transfer_function.hpp"

#include <cmath>

#include "base/invalid_argument.hpp"

namespace control {
namespace {

[[noreturn]] void refuse(const char* what, double value) { base::throw_invalid("controller: ", what, ' ', value); }

}  // namespace

void check(const FopdController& controller) {
  if (!(controller.kp > 0 && std::isfinite(controller.kp))) refuse("kp must be positive, is", controller.kp);
  if (!(controller.kd >= 0 && std::isfinite(controller.kd))) refuse("kd must be 0 or positive, is", controller.kd);
  if (!(controller.mu > 0 && controller.mu < 2)) refuse("mu must lie in (0, 2), is", controller.mu);
}

Complex denominator(const FractionalModel& model, Complex log_s) {
  const Complex first = model.b1 == 0 ? 0.0 : model.b1 * std::exp(model.alpha * log_s);
  return first + model.b2 * std::exp(model.beta * log_s) + model.b3;
}

Complex denominator_slope(const FractionalModel& model, Complex log_s) {
  const Complex first = model.b1 == 0 ? 0.0 : model.alpha * model.b1 * std::exp((model.alpha - 1) * log_s);
  return first + model.beta * model.b2 * std::exp((model.beta - 1) * log_s);
}

Complex velocity_transfer(const FractionalModel& model, Complex s) {
  return model.kp / denominator(model, std::log(s)) * std::exp(-s * model.dead_time_s);
}

Complex controller_transfer(const FopdController& controller, Complex s) {
  return controller.kp * (1.0 + controller.kd * std::exp(controller.mu * std::log(s)));
}

}  // namespace control
