// Finds the closed-loop poles and a ray far from all of them, and integrates along it.
#include "control/responses/continuous_loop.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "base/invalid_argument.hpp"

namespace control {
namespace {

using std::numbers::pi;

constexpr double kLogReach = 40;                   // of |s| to either side of a, for (5)
constexpr double kPhaseStep = 0.1;                 // of ln|s|, for (5), halved beside zeros
constexpr double kSmallestPhaseStep = 1e-13;       // a zero on the ray itself
constexpr double kSearchStep = 2e-3;               // of ln|s|, where only a zero makes Q small
constexpr double kSteepest = 3;                    // the largest exponent of Q
constexpr double kLastAngleRad = pi * (1 - 1e-3);  // zeros beyond it count as on the cut
constexpr double kDigits = 32;                     // exp(-kDigits): what (4) leaves
constexpr double kLogNodes = 90;                   // of |s| to either side of a, at most, for (4)
constexpr double kNegligible = 1e-17;
constexpr double kGridPoints = 2000, kMostGridPoints = 100'000;
constexpr double kGridPerRate = 0.1;   // the step of the grid, of 1/a
constexpr double kLeastExcess = 0.25;  // of the order of s D over that of C
constexpr int kBisections = 60;

double plant_order(const FractionalModel& plant) { return 1 + (plant.b1 > 0 ? plant.alpha : plant.beta); }

struct Loop {
  FractionalModel plant;
  FopdController controller;
  double log_rate = 0;  // ln a

  Complex control(Complex log_s) const {  // K C
    return plant.kp * controller.kp * (1.0 + controller.kd * std::exp(controller.mu * log_s));
  }
  Complex integrated(Complex log_s) const { return std::exp(log_s) * denominator(plant, log_s); }  // s D
  Complex polynomial(Complex log_s) const { return integrated(log_s) + control(log_s); }           // Q
  // Σ of the magnitudes of the terms of Q: it grows with |s|, and kSteepest times it bounds |dQ/d ln s|.
  double magnitude(double log_rate_of_s) const {
    return integrated(log_rate_of_s).real() + control(log_rate_of_s).real();
  }
  Complex slope(Complex log_s) const {  // s Q'
    const Complex s = std::exp(log_s), controlled = std::exp(controller.mu * log_s);
    return s * (denominator(plant, log_s) + s * denominator_slope(plant, log_s)) +
           plant.kp * controller.kp * controller.kd * controller.mu * controlled;
  }
};

// Where condition turns from true at `low` to false at `high`.
template <class Condition>
double bisect(double low, double high, Condition condition) {
  for (int i = 0; i < kBisections; ++i) {
    const double middle = (low + high) / 2;
    (condition(middle) ? low : high) = middle;
  }
  return (low + high) / 2;
}

double crossover_log_rate(const Loop& loop) {
  return bisect(-2 * kLogReach, 2 * kLogReach, [&](double log_rate) {
    const Complex log_s{log_rate, pi / 2};
    return std::abs(loop.control(log_s)) > std::abs(loop.integrated(log_s));
  });
}

// How far arg Q turns along the ray between two of its points: less than half a turn if Q cannot come to 0 on the way.
double turned(const Loop& loop, double angle_rad, double low, Complex at_low, double high, Complex at_high) {
  const double change = kSteepest * loop.magnitude(high) * (high - low);
  if (change < std::max(std::abs(at_low), std::abs(at_high)) || high - low < kSmallestPhaseStep) {
    return std::arg(at_high / at_low);
  }
  const double middle = (low + high) / 2;
  const Complex at_middle = loop.polynomial({middle, angle_rad});
  return turned(loop, angle_rad, low, at_low, middle, at_middle) +
         turned(loop, angle_rad, middle, at_middle, high, at_high);
}

// (5)
long zeros_before(const Loop& loop, double angle_rad) {
  const double order = plant_order(loop.plant), log_rate = loop.log_rate;
  double low = log_rate - kLogReach;
  Complex at_low = loop.polynomial({low, angle_rad});
  double grown = std::arg(at_low);
  while (low < log_rate + kLogReach) {
    const double high = low + kPhaseStep;
    const Complex at_high = loop.polynomial({high, angle_rad});
    grown += turned(loop, angle_rad, low, at_low, high, at_high);
    low = high;
    at_low = at_high;
  }
  return std::lround((order * angle_rad - grown) / (2 * pi));
}

// ln p of the zero at this angle: where |Q| is least along the ray, then Newton.
Complex zero_at(const Loop& loop, double angle_rad) {
  Complex best{loop.log_rate, angle_rad};
  double least = std::numeric_limits<double>::infinity();
  for (double y = loop.log_rate - kLogReach; y < loop.log_rate + kLogReach; y += kSearchStep) {
    const Complex log_s{y, angle_rad};
    const double size = std::abs(loop.polynomial(log_s)) / loop.magnitude(y);
    if (size < least) least = size, best = log_s;
  }
  for (int i = 0; i < kBisections; ++i) {
    const Complex correction = loop.polynomial(best) / loop.slope(best);
    best -= correction;
    if (!(std::abs(correction) > 1e-15)) break;
  }
  return best;
}

// ln p of the zeros between the imaginary axis and the cut, in the order of their angles.
std::vector<Complex> log_zeros(const Loop& loop) {
  const long count = zeros_before(loop, kLastAngleRad);
  std::vector<Complex> zeros;
  double low = pi / 2;
  for (long before = 0; before < count; ++before) {
    low = bisect(low, kLastAngleRad, [&](double angle_rad) { return zeros_before(loop, angle_rad) <= before; });
    zeros.push_back(zero_at(loop, low));
    if (std::abs(zeros.back().imag() - low) < 1e-6) continue;
    base::throw_invalid("continuous loop: found no closed-loop pole at ", low,
                        " rad, where one must be; please report the ", "plant and kp ", loop.controller.kp, ", kd ",
                        loop.controller.kd, ", mu ", loop.controller.mu);
  }
  return zeros;
}

Loop checked(const FractionalModel& plant, const FopdController& controller) {
  check(plant);
  check(controller);
  if (!(plant.kp > 0)) base::throw_invalid("continuous loop: the plant's kp must be positive, is ", plant.kp);
  if (plant.dead_time_s > 0) {
    base::throw_invalid("continuous loop: the plant must have no dead time, has ", plant.dead_time_s,
                        " s; predict_closed_loop takes one");
  }
  if (controller.kd > 0 && controller.mu > plant_order(plant) - kLeastExcess) {
    base::throw_invalid("continuous loop: mu must be at most ", plant_order(plant) - kLeastExcess,
                        " with this plant, or the loop follows at once, is ", controller.mu);
  }
  Loop loop{plant, controller};
  loop.log_rate = crossover_log_rate(loop);
  if (zeros_before(loop, pi / 2) != 0) {
    base::throw_invalid("continuous loop: kp ", controller.kp, ", kd ", controller.kd, ", mu ", controller.mu,
                        " make the loop with this plant unstable; take a lower kp");
  }
  return loop;
}

// The ends of the widest gap.
std::pair<double, double> widest_gap(const std::vector<Complex>& zeros) {
  double last = pi / 2;
  std::pair<double, double> widest{last, last};
  const auto end_at = [&](double angle_rad) {
    if (angle_rad - last > widest.second - widest.first) widest = {last, angle_rad};
    last = angle_rad;
  };
  for (const Complex zero : zeros) end_at(zero.imag());
  end_at(pi);
  return widest;
}

}  // namespace

ContinuousLoop::ContinuousLoop(const FractionalModel& plant, const FopdController& controller, double ray) {
  if (!(ray > 0 && ray < 1)) base::throw_invalid("continuous loop: ray must lie in (0, 1), is ", ray);
  const Loop loop = checked(plant, controller);
  rate_rad_s_ = std::exp(loop.log_rate);
  const std::vector<Complex> zeros = log_zeros(loop);
  const auto [low, high] = widest_gap(zeros);
  const double angle_rad = low + ray * (high - low), step = 2 * pi * std::min(ray, 1 - ray) * (high - low) / kDigits;
  for (const Complex zero : zeros) {  // (3); Im[2i z] = 2 Re[z]
    if (zero.imag() > low) break;
    const Complex pole = std::exp(zero);
    poles_.push_back({pole, Complex(0, 2) * -loop.integrated(zero) / loop.slope(zero)});
  }
  const auto add = [&](double log_rate) {
    const Complex log_s{log_rate, angle_rad}, s = std::exp(log_s);
    const Complex rest = s / (s + rate_rad_s_) - loop.integrated(log_s) / loop.polynomial(log_s);
    nodes_.push_back({s, step / pi * rest});
    return std::abs(rest) > kNegligible;
  };
  for (double y = 0; y < kLogNodes && add(loop.log_rate + y);) y += step;
  std::ranges::reverse(nodes_);
  for (double y = -step; y > -kLogNodes && add(loop.log_rate + y);) y -= step;
}

std::span<const ContinuousLoop::Node> ContinuousLoop::living(double time_s) const {
  const auto first =
      std::ranges::partition_point(nodes_, [&](const Node& node) { return node.rate.real() * time_s < -kDigits - 8; });
  return {first, nodes_.end()};
}

double ContinuousLoop::position(double time_s) const {
  if (!(time_s >= 0)) base::throw_invalid("continuous loop: time_s must be 0 or positive, is ", time_s);
  if (time_s == 0) return 0;
  double sum = -std::expm1(-rate_rad_s_ * time_s);
  for (const auto& pole : poles_) sum += (pole.weight * std::exp(pole.rate * time_s)).imag();
  for (const auto& node : living(time_s)) sum += (node.weight * std::exp(node.rate * time_s)).imag();
  return sum;
}

double ContinuousLoop::velocity(double time_s) const {
  if (!(time_s > 0)) base::throw_invalid("continuous loop: time_s must be positive, is ", time_s);
  double sum = rate_rad_s_ * std::exp(-rate_rad_s_ * time_s);
  for (const auto& pole : poles_) sum += (pole.weight * pole.rate * std::exp(pole.rate * time_s)).imag();
  for (const auto& node : living(time_s)) sum += (node.weight * node.rate * std::exp(node.rate * time_s)).imag();
  return sum;
}

ContinuousStep measure_continuous_step(const ContinuousLoop& loop, double horizon_s) {
  if (!(horizon_s > 0 && std::isfinite(horizon_s))) {
    base::throw_invalid("continuous loop: horizon_s must be positive, is ", horizon_s);
  }
  ContinuousStep step;
  const double wanted = std::max(kGridPoints, horizon_s * loop.rate_rad_s() / kGridPerRate);
  const int points = static_cast<int>(std::min(wanted, kMostGridPoints));
  const double grid_s = horizon_s / points;
  double last_outside_s = 0;
  for (int i = 1; i <= points; ++i) {
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
