// Finds a ray that leaves the closed-loop poles on its left, and integrates along it.
#include "control/continuous_loop.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "control/invalid_argument.hpp"

namespace control {
namespace {

using std::numbers::pi;

constexpr double kLogLow = -36, kLogHigh = 40;  // of |s|, for (4)
constexpr int kPhaseSteps = 1500;
constexpr int kAngles = 60;          // between the imaginary axis and the cut
constexpr double kDigits = 32;       // exp(-kDigits): what (3) leaves
constexpr double kShortestS = 1e-3;  // the sum reaches far enough for times from here on
constexpr double kSmallestGapRad = 2e-3;
constexpr int kMostNodes = 20'000;
constexpr int kGridPoints = 2000;
constexpr int kBisections = 60;

Complex loop_polynomial(const FractionalModel& plant, const FopdController& controller, Complex log_s) {
  return std::exp(log_s) * denominator(plant, log_s) +
         plant.kp * controller.kp * (1.0 + controller.kd * std::exp(controller.mu * log_s));
}

// (4)
long zeros_before(const FractionalModel& plant, const FopdController& controller, double angle_rad) {
  const double order = std::max(1 + (plant.b1 > 0 ? plant.alpha : plant.beta), controller.kd > 0 ? controller.mu : 0);
  double grown = 0;
  Complex last = loop_polynomial(plant, controller, {kLogLow, angle_rad});
  for (int i = 1; i <= kPhaseSteps; ++i) {
    const double log_rate = kLogLow + (kLogHigh - kLogLow) * i / kPhaseSteps;
    const Complex next = loop_polynomial(plant, controller, {log_rate, angle_rad});
    grown += std::arg(next / last);
    last = next;
  }
  return std::lround((order * angle_rad - grown) / (2 * pi));
}

// The first zero to the left of the imaginary axis, or the cut, as an angle from that axis.
double free_angle(const FractionalModel& plant, const FopdController& controller) {
  if (zeros_before(plant, controller, pi / 2) != 0) {
    throw_invalid("continuous loop: kp ", controller.kp, ", kd ", controller.kd, ", mu ", controller.mu,
                  " make the loop with this plant unstable; take a lower kp");
  }
  double free_rad = pi / 2;  // no zero up to here
  for (int i = 1; i <= kAngles; ++i) {
    const double angle_rad = pi / 2 * (1 + static_cast<double>(i) / kAngles * (1 - 1e-6));
    if (zeros_before(plant, controller, angle_rad) != 0) break;
    free_rad = angle_rad;
  }
  return free_rad - pi / 2;
}

// Where condition turns from true at `low` to false at `high`.
template <class Condition>
double bisect(double low, double high, Condition condition) {
  for (int i = 0; i < kBisections; ++i) {
    const double middle = (low + high) / 2;
    (condition(middle) ? low : high) = middle;
  }
  return (low + high) / 2;
}

}  // namespace

ContinuousLoop::ContinuousLoop(const FractionalModel& plant, const FopdController& controller, double ray) {
  check(plant);
  check(controller);
  if (!(plant.kp > 0)) throw_invalid("continuous loop: the plant's kp must be positive, is ", plant.kp);
  if (!(ray > 0 && ray < 1)) throw_invalid("continuous loop: ray must lie in (0, 1), is ", ray);
  const double free_rad = std::max(free_angle(plant, controller), kSmallestGapRad), angle_rad = pi / 2 + ray * free_rad;
  const double step = 2 * pi * std::min(ray, 1 - ray) * free_rad / kDigits;
  const double log_high = std::log(kDigits / (-std::cos(angle_rad) * kShortestS));
  const int count = std::min(kMostNodes, static_cast<int>((log_high - kLogLow) / step) + 1);
  for (int i = 0; i < count; ++i) {
    const Complex log_s{log_high - i * step, angle_rad}, s = std::exp(log_s);
    nodes_.push_back({s, -step / pi * s * denominator(plant, log_s) / loop_polynomial(plant, controller, log_s)});
  }
}

std::span<const ContinuousLoop::Node> ContinuousLoop::living(double time_s) const {
  const auto first =
      std::ranges::partition_point(nodes_, [&](const Node& node) { return node.rate.real() * time_s < -kDigits - 8; });
  return {first, nodes_.end()};
}

double ContinuousLoop::position(double time_s) const {
  double sum = 1;
  for (const auto& node : living(time_s)) sum += (node.weight * std::exp(node.rate * time_s)).imag();
  return sum;
}

double ContinuousLoop::velocity(double time_s) const {
  double sum = 0;
  for (const auto& node : living(time_s)) sum += (node.weight * node.rate * std::exp(node.rate * time_s)).imag();
  return sum;
}

ContinuousStep measure_continuous_step(const ContinuousLoop& loop, double horizon_s) {
  ContinuousStep step;
  const double grid_s = horizon_s / kGridPoints;
  double last_outside_s = 0;
  for (int i = 1; i <= kGridPoints; ++i) {
    const double time_s = i * grid_s, position = loop.position(time_s);
    if (std::abs(position - 1) > 0.02) last_outside_s = time_s;
    if (position <= step.peak) continue;
    step.peak = position;
    step.peak_time_s = time_s;
  }
  if (step.peak > 1) {
    const double low_s = std::max(step.peak_time_s - grid_s, grid_s / 10);
    step.peak_time_s = bisect(low_s, step.peak_time_s + grid_s, [&](double t) { return loop.velocity(t) > 0; });
    step.peak = loop.position(step.peak_time_s);
    step.overshoot_percent = 100 * (step.peak - 1);
  }
  if (last_outside_s < horizon_s) {
    const auto is_outside = [&](double t) { return std::abs(loop.position(t) - 1) > 0.02; };
    step.settling_2_percent_s = bisect(last_outside_s, last_outside_s + grid_s, is_outside);
  }
  return step;
}

}  // namespace control
