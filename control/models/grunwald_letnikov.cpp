// The scheme, term by term.
#include "control/models/grunwald_letnikov.hpp"

#include <algorithm>
#include <cmath>

#include "base/invalid_argument.hpp"

namespace control {
namespace {

constexpr std::size_t kMostSamples = 200'000;

[[noreturn]] void refuse(const char* what, double value) {
  base::throw_invalid("Grünwald-Letnikov: ", what, ' ', value);
}

// c_0 .. c_{count-1} of (1).
std::vector<double> coefficients(const FractionalModel& model, double dt_s, std::size_t count) {
  const double first = model.b1 * std::pow(dt_s, -model.alpha), second = model.b2 * std::pow(dt_s, -model.beta);
  double first_weight = 1, second_weight = 1;
  std::vector<double> c{first + second};
  for (std::size_t j = 1; j < count; ++j) {
    first_weight *= 1 - (model.alpha + 1) / static_cast<double>(j);  // (2)
    second_weight *= 1 - (model.beta + 1) / static_cast<double>(j);
    c.push_back(first * first_weight + second * second_weight);
  }
  return c;
}

}  // namespace

std::vector<double> grunwald_letnikov_velocity(const FractionalModel& model, double dt_s, std::span<const double> duty,
                                               std::size_t terms) {
  check(model);
  if (model.dead_time_s > 0) refuse("the model must have no dead time, has", model.dead_time_s);
  if (!(dt_s > 0 && std::isfinite(dt_s))) refuse("dt_s must be positive, is", dt_s);
  if (duty.size() > kMostSamples) {
    base::throw_invalid("Grünwald-Letnikov: at most ", kMostSamples, " samples, there are ", duty.size(),
                        "; lengthen dt_s, or use step_response or ModalPlant");
  }
  for (const double u : duty) {
    if (!std::isfinite(u)) refuse("duty must be finite, is", u);
  }
  const std::size_t kept = terms == 0 ? duty.size() : std::min(terms, duty.size());
  const std::vector<double> c = coefficients(model, dt_s, kept);
  std::vector<double> velocity_m_s;
  for (std::size_t k = 0; k < duty.size(); ++k) {
    double past = 0;
    for (std::size_t j = 1; j <= k && j < kept; ++j) past += c[j] * velocity_m_s[k - j];
    velocity_m_s.push_back((model.kp * duty[k] - past) / (c[0] + model.b3));  // (1)
  }
  return velocity_m_s;
}

}  // namespace control
