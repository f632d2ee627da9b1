// Talbot for steps, exponentials for sampled duties.
#include "control/responses/time_response.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/invalid_argument.hpp"
#include "control/models/modal_form.hpp"

namespace control {
namespace {

using std::numbers::pi;

constexpr int kNodes = 32;  // N of (2): the contour errs by e^{-1.36 N}, rounding by e^{0.17 N} of the last digit
constexpr double kNarrowestRad = 0.88 * pi;  // poles nearer to the negative axis stay inside the contour
constexpr double kModalTolerance = 1e-12;
constexpr double kOneEvent = 8 * std::numeric_limits<double>::epsilon();  // relative; nearer times are the same

[[noreturn]] void refuse(const char* what, double value) { base::throw_invalid("time response: ", what, ' ', value); }

// A point z = s t of the upper half of (2), and e^z dz/dφ · 2/N.
struct Node {
  Complex z, log_z, weight;
};

std::array<Node, kNodes / 2> talbot_nodes() {
  constexpr double kN = kNodes;
  std::array<Node, kNodes / 2> nodes;
  for (int k = 0; k < kNodes / 2; ++k) {
    const double phi = (2 * k + 1) * pi / kN, angle = 0.6407 * phi, sine = std::sin(angle);
    const double cotangent = std::cos(angle) / sine;
    const Complex z = kN * Complex{0.5017 * phi * cotangent - 0.6122, 0.2645 * phi};
    const Complex slope = kN * Complex{0.5017 * (cotangent - 0.6407 * phi / (sine * sine)), 0.2645};
    nodes[static_cast<std::size_t>(k)] = {z, std::log(z), 2 / kN * slope * std::exp(z)};
  }
  return nodes;
}

struct Motion {
  double velocity_m_s = 0;
  double position_m = 0;
};

// (1) at one time, duty 1. The pair is taken off where the contour would pass near it.
Motion unit_step(const FractionalModel& model, const std::optional<PolePair>& pair, double t) {
  static const auto kTalbot = talbot_nodes();
  const double log_t = std::log(t);
  const bool subtract = pair && std::abs(pair->pole) * t > 1;
  const Complex pole = subtract ? pair->pole * t : 0.0;               // of H/z and H/z² in z
  const Complex residue = subtract ? pair->residue * t / pole : 0.0;  // of H/z
  Motion sum;
  for (const Node& node : kTalbot) {
    const Complex response = model.kp / denominator(model, node.log_z - log_t);
    Complex velocity = response / node.z, position = velocity / node.z;
    if (subtract) {
      const Complex pair_sum = residue / (node.z - pole) + std::conj(residue) / (node.z - std::conj(pole));
      velocity -= pair_sum;
      position -= residue / pole / (node.z - pole) + std::conj(residue / pole) / (node.z - std::conj(pole));
    }
    sum.velocity_m_s += (node.weight * velocity).imag();
    sum.position_m += (node.weight * position).imag();
  }
  if (subtract) {
    sum.velocity_m_s += 2 * (residue * std::exp(pole)).real();
    sum.position_m += 2 * (residue / pole * std::exp(pole)).real();
  }
  sum.position_m *= t;
  return sum;
}

void check_samples(std::span<const double> time_s, std::span<const double> duty) {
  if (time_s.size() != duty.size()) {
    refuse("duty must have as many values as time_s, the difference is",
           static_cast<double>(duty.size()) - static_cast<double>(time_s.size()));
  }
  if (time_s.empty()) refuse("time_s must have at least one value, has", 0);
  for (std::size_t k = 0; k < time_s.size(); ++k) {
    if (!std::isfinite(time_s[k])) refuse("time_s must be finite, is", time_s[k]);
    if (!std::isfinite(duty[k])) refuse("duty must be finite, is", duty[k]);
    if (k > 0 && !(time_s[k] > time_s[k - 1])) refuse("time_s must ascend strictly, does not at", time_s[k]);
  }
}

ModalRange range_of(std::span<const double> time_s) {
  double shortest_s = std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k < time_s.size(); ++k) shortest_s = std::min(shortest_s, time_s[k] - time_s[k - 1]);
  return {shortest_s, std::max(time_s.back() - time_s.front(), 2 * shortest_s), kModalTolerance};
}

// All modes of a model, advanced by intervals of any length.
class Modes {
 public:
  explicit Modes(ModalForm form) : form_(std::move(form)), state_(form_.rate.size()) {}

  // Times are known to rounding_s, so intervals that differ by no more are the same.
  Motion advance(double dt_s, double rounding_s, double duty) {
    const std::vector<StepFactors>& factors = factors_of(dt_s, rounding_s);
    double velocity_m_s = 0, moved_m = 0;
    for (std::size_t i = 0; i < state_.size(); ++i) {
      const Complex force = form_.weight[i] * duty;
      moved_m += (factors[i].integral * state_[i] + factors[i].double_integral * force).real();
      state_[i] = factors[i].decay * state_[i] + factors[i].integral * force;
      velocity_m_s += state_[i].real();
    }
    return {2 * velocity_m_s, 2 * moved_m};
  }

 private:
  struct Interval {
    double dt_s = std::numeric_limits<double>::quiet_NaN();
    std::vector<StepFactors> factors;
  };

  // Of the last two lengths: a dead time makes equal intervals two, which take turns.
  const std::vector<StepFactors>& factors_of(double dt_s, double rounding_s) {
    for (const Interval& interval : intervals_) {
      if (std::abs(dt_s - interval.dt_s) <= rounding_s) return interval.factors;
    }
    std::swap(intervals_[0], intervals_[1]);
    intervals_[0].dt_s = dt_s;
    intervals_[0].factors.clear();
    for (const Complex rate : form_.rate) intervals_[0].factors.push_back(step_factors(rate, dt_s));
    return intervals_[0].factors;
  }

  ModalForm form_;
  std::vector<Complex> state_;
  std::array<Interval, 2> intervals_;
};

// By (3): duty acts until the next event; a sample is wanted where it has an index.
struct Event {
  double time_s = 0;
  std::optional<std::size_t> sample, duty;
};

// Both lists merged: duties that begin to act, and samples. Those within rounding of each other are one event.
std::vector<Event> events_of(std::span<const double> time_s, double dead_time_s) {
  std::vector<Event> events;
  std::size_t sample = 0, duty = 0;
  while (sample < time_s.size()) {
    const double sampled_s = time_s[sample], acts_s = time_s[duty] + dead_time_s, apart_s = sampled_s - acts_s;
    const bool is_one = std::abs(apart_s) <= kOneEvent * std::max(std::abs(sampled_s), std::abs(acts_s));
    Event event{is_one || apart_s < 0 ? sampled_s : acts_s, {}, {}};
    if (is_one || apart_s < 0) event.sample = sample++;
    if (is_one || apart_s > 0) event.duty = duty++;
    events.push_back(event);
  }
  return events;
}

TimeResponse delayed_response(const FractionalModel& model, std::span<const double> time_s,
                              std::span<const double> duty) {
  const std::vector<Event> events = events_of(time_s, model.dead_time_s);
  std::vector<double> event_s;
  for (const Event& event : events) event_s.push_back(event.time_s);
  Modes modes{modal_form(model, range_of(event_s))};
  TimeResponse response;
  double acting = 0, position_m = 0, velocity_m_s = 0, before_s = event_s.front();
  for (const Event& event : events) {
    if (event.time_s > before_s) {
      const double rounding_s =
          std::numeric_limits<double>::epsilon() * std::max(std::abs(event.time_s), std::abs(before_s));
      const Motion motion = modes.advance(event.time_s - before_s, rounding_s, acting);
      velocity_m_s = motion.velocity_m_s;
      position_m += motion.position_m;
      before_s = event.time_s;
    }
    if (event.duty) acting = duty[*event.duty];
    if (!event.sample) continue;
    response.velocity_m_s.push_back(velocity_m_s);
    response.position_m.push_back(position_m);
  }
  return response;
}

}  // namespace

TimeResponse step_response(const FractionalModel& model, double duty, std::span<const double> time_s) {
  check(model);
  if (!std::isfinite(duty)) refuse("duty must be finite, is", duty);
  const std::optional<PolePair> pair = pole_pair(model, kNarrowestRad);
  TimeResponse response;
  for (const double t : time_s) {
    if (!(t >= 0 && std::isfinite(t))) refuse("times must be finite and not negative, is", t);
    const double acting_s = t - model.dead_time_s;
    const Motion motion = acting_s > 0 ? unit_step(model, pair, acting_s) : Motion{};
    response.velocity_m_s.push_back(duty * motion.velocity_m_s);
    response.position_m.push_back(duty * motion.position_m);
  }
  return response;
}

TimeResponse sampled_response(const FractionalModel& model, std::span<const double> time_s,
                              std::span<const double> duty) {
  check(model);
  check_samples(time_s, duty);
  TimeResponse response{{0}, {0}};
  if (time_s.size() == 1) return response;
  if (model.dead_time_s > 0) return delayed_response(model, time_s, duty);
  Modes modes{modal_form(model, range_of(time_s))};
  for (std::size_t k = 1; k < time_s.size(); ++k) {
    const double rounding_s =
        std::numeric_limits<double>::epsilon() * std::max(std::abs(time_s[k]), std::abs(time_s[k - 1]));
    const Motion motion = modes.advance(time_s[k] - time_s[k - 1], rounding_s, duty[k - 1]);
    response.velocity_m_s.push_back(motion.velocity_m_s);
    response.position_m.push_back(response.position_m.back() + motion.position_m);
  }
  return response;
}

}  // namespace control
