// Finds crossovers and peaks among the samples of the loop, and polishes them.
#include "control/responses/margins.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/invalid_argument.hpp"
#include "control/responses/frequency_response.hpp"
#include "control/responses/loop_scan.hpp"

namespace control {
namespace {

using std::numbers::pi;

constexpr double kDbPerNeper = 20 / std::numbers::ln10;
constexpr int kPeaksPolished = 3;
constexpr double kListedLogGain = -2.3;  // ln 0.1: phase crossovers that a dead time makes below it are not listed

void check_frequency(double omega_rad_s) {
  if (omega_rad_s > 0 && std::isfinite(omega_rad_s)) return;
  base::throw_invalid("frequency must be positive and finite, is ", omega_rad_s, " rad/s");
}

// One real quantity along the axis, with its slope in ln ω.
struct ValueAndSlope {
  double value = 0, slope = 0;
};

ValueAndSlope log_gain(const AxisPoint& point) { return {point.log_magnitude, point.log_slope.real()}; }

// The root between two points where the signs differ: Newton's method, halving instead where that would leave them.
template <class Function>
double root_between(double low, double high, const Function& f) {
  const bool rises = f(low).value < 0;
  double x = (low + high) / 2;
  for (int i = 0; i < 200; ++i) {
    const auto [value, slope] = f(x);
    if (value == 0) return x;
    ((value < 0) == rises ? low : high) = x;
    double next = x - value / slope;
    if (!(next > low && next < high)) next = (low + high) / 2;
    if (std::abs(next - x) <= 2e-16 * std::max(1.0, std::abs(x))) return next;
    x = next;
  }
  return x;
}

// Where the slope changes its sign between two points.
template <class Function>
double extremum_between(double low, double high, const Function& f) {
  const bool falls_at_low = f(low).slope < 0;
  for (int halving = 0; halving < 60; ++halving) {
    const double middle = (low + high) / 2;
    ((f(middle).slope < 0) == falls_at_low ? low : high) = middle;
  }
  return (low + high) / 2;
}

// Every ln ω between two samples where the quantity is 0. Between two of one sign it may come to 0 and turn back: the
// slopes tell.
template <class Quantity>
void add_zeros(const LoopOnAxis& loop, const Sample& left, const Sample& right, const Quantity& quantity,
               std::vector<double>& found) {
  const auto f = [&](double log_omega) { return quantity(loop.at(log_omega)); };
  const ValueAndSlope a = quantity(left.loop), b = quantity(right.loop);
  if (a.value == 0) {
    found.push_back(left.log_omega);
  } else if (a.value * b.value < 0) {
    found.push_back(root_between(left.log_omega, right.log_omega, f));
  } else if (a.value * a.slope < 0 && b.value * b.slope > 0) {
    const double turn = extremum_between(left.log_omega, right.log_omega, f);
    if (f(turn).value * a.value >= 0) return;
    found.push_back(root_between(left.log_omega, turn, f));
    found.push_back(root_between(turn, right.log_omega, f));
  }
}

std::vector<double> find_gain_crossovers(const LoopOnAxis& loop, const std::vector<Sample>& samples) {
  std::vector<double> found;
  for (std::size_t i = 0; i + 1 < samples.size(); ++i) add_zeros(loop, samples[i], samples[i + 1], log_gain, found);
  return found;
}

// How often L has gone round, and so past the axis on the left, by this phase; falls by 1 for each odd multiple of -π.
double sheet(double phase_rad) { return std::floor((phase_rad + pi) / (2 * pi)); }

// Where the phase is an odd multiple of -π. Beyond kMostTurnsRad the samples do not follow the turns: none from there.
std::vector<double> find_phase_crossovers(const OpenLoop& loop, const LoopOnAxis& on_axis,
                                          const std::vector<Sample>& samples) {
  std::vector<double> found;
  for (std::size_t i = 0; i + 1 < samples.size(); ++i) {
    const Sample &left = samples[i], &right = samples[i + 1];
    const double lag_rad = loop.plant.dead_time_s * (std::exp(right.log_omega) - std::exp(left.log_omega));
    if (lag_rad > 2 * kTurnStepRad) continue;
    const double first = std::round(left.loop.phase_rad / (2 * pi) - 0.5);
    const double last = std::round(right.loop.phase_rad / (2 * pi) - 0.5);
    const std::size_t before = found.size();
    for (double turn = std::min(first, last); turn <= std::max(first, last); ++turn) {
      const auto above = [turn](const AxisPoint& point) {
        return ValueAndSlope{point.phase_rad - (2 * turn + 1) * pi, point.log_slope.imag()};
      };
      add_zeros(on_axis, left, right, above, found);
    }
    std::sort(found.begin() + static_cast<std::ptrdiff_t>(before), found.end());
  }
  return found;
}

double sensitivity(Complex loop) { return 1 / std::sqrt(std::norm(1.0 + loop)); }
double complementary_sensitivity(Complex loop) { return std::sqrt(std::norm(loop) / std::norm(1.0 + loop)); }

struct Peak {
  double value = 0, log_omega = 0;
};

// The largest value between two points that enclose one peak, by golden section.
template <class Function>
Peak peak_between(double low, double high, const Function& f) {
  constexpr double kGolden = std::numbers::phi - 1;
  double a = high - kGolden * (high - low), b = low + kGolden * (high - low);
  double at_a = f(a), at_b = f(b);
  while (high - low > 1e-9) {
    if (at_a > at_b) {
      high = b, b = a, at_b = at_a;
      a = high - kGolden * (high - low), at_a = f(a);
    } else {
      low = a, a = b, at_a = at_b;
      b = low + kGolden * (high - low), at_b = f(b);
    }
  }
  return at_a > at_b ? Peak{at_a, a} : Peak{at_b, b};
}

// The largest value over the samples, with the highest few of the local maxima polished.
Peak highest_peak(const LoopOnAxis& loop, const std::vector<Sample>& samples, double (*measure)(Complex)) {
  std::vector<double> values(samples.size());
  std::ranges::transform(samples, values.begin(), [measure](const Sample& s) { return measure(s.loop.value); });
  std::vector<std::size_t> maxima;
  for (std::size_t i = 1; i + 1 < values.size(); ++i) {
    if (values[i] >= values[i - 1] && values[i] > values[i + 1]) maxima.push_back(i);
  }
  const auto polished = std::min<std::ptrdiff_t>(kPeaksPolished, std::ssize(maxima));
  std::ranges::partial_sort(maxima, maxima.begin() + polished, std::greater{},
                            [&](std::size_t i) { return values[i]; });
  Peak best;
  for (const std::size_t i : std::span{maxima}.first(static_cast<std::size_t>(polished))) {
    const Peak peak = peak_between(samples[i - 1].log_omega, samples[i + 1].log_omega,
                                   [&](double log_omega) { return measure(loop.at(log_omega).value); });
    if (peak.value > best.value) best = peak;
  }
  return best;
}

// L at ω → 0 and ω → ∞; infinite where |L| grows without end.
double left_limit(const OpenLoop& loop) {
  return loop.is_velocity_loop ? std::copysign(std::exp(log_dc_gain(loop)), loop.plant.kp) : HUGE_VAL;
}

double right_limit(const OpenLoop& loop) {
  const Asymptote right = right_asymptote(loop);
  if (right.slope != 0) return right.slope > 0 ? HUGE_VAL : 0;
  const double limit = std::exp(right.log_gain);
  return loop.plant.dead_time_s > 0 ? -limit : std::copysign(limit, loop.plant.kp);  // -1 is the worst of its turns
}

// (5). The crossovers join the samples: peaks sharper than the scan stand near them.
void find_peaks(Margins& result, const OpenLoop& loop, const LoopOnAxis& on_axis, std::vector<Sample> samples,
                std::span<const double> crossovers) {
  for (const double log_omega : crossovers) samples.push_back({log_omega, on_axis.at(log_omega)});
  std::ranges::sort(samples, {}, &Sample::log_omega);
  Peak s = highest_peak(on_axis, samples, sensitivity), t = highest_peak(on_axis, samples, complementary_sensitivity);
  const auto include = [&](double limit, double log_omega) {
    const double s_limit = std::abs(1 / (1 + limit)), t_limit = std::isinf(limit) ? 1 : std::abs(limit) * s_limit;
    if (s_limit > s.value) s = {s_limit, log_omega};
    if (t_limit > t.value) t = {t_limit, log_omega};
  };
  if (loop.plant.dead_time_s > 0) {
    for (const Sample& sample : samples) {
      const bool turns = loop.plant.dead_time_s * std::exp(sample.log_omega) > kMostTurnsRad;
      if (turns) include(-std::exp(sample.loop.log_magnitude), sample.log_omega);
    }
  }
  include(left_limit(loop), samples.front().log_omega);
  include(right_limit(loop), samples.back().log_omega);
  result.ms = s.value, result.ms_at_rad_s = std::exp(s.log_omega);
  result.mt = t.value, result.mt_at_rad_s = std::exp(t.log_omega);
}

// The plant is stable, so 1 + L has no zero on the right exactly if L does not go round -1: where |L| > 1 it passes the
// axis on the left of -1 as often up as down. Where that begins and ends are the gain crossovers, so (6) needs the
// phases there and no others, however often a dead time turns L. A negative gain adds one passage at ω = 0, which
// nothing balances; so does, without end, a dead time where |L| does not fall below 1.
bool is_stable(const OpenLoop& loop, const LoopOnAxis& on_axis, const std::vector<Sample>& samples,
               std::span<const double> crossovers) {
  const AxisPoint &first = samples.front().loop, &last = samples.back().loop;
  const bool passes_at_0 = loop.plant.kp < 0 && (!loop.is_velocity_loop || log_dc_gain(loop) > 0);
  const Asymptote right = right_asymptote(loop);
  const bool turns_for_ever = right.slope > 0 || (right.slope == 0 && right.log_gain >= 0);
  if (passes_at_0 || (loop.plant.dead_time_s > 0 && turns_for_ever)) return false;
  double rounds = (first.log_magnitude > 0 ? sheet(first.phase_rad) : 0) -
                  (last.log_magnitude > 0 ? sheet(last.phase_rad) : 0);  // (6)
  for (const double log_omega : crossovers) {
    const AxisPoint point = on_axis.at(log_omega);
    const double slope = point.log_slope.real();
    if (slope != 0) rounds += slope > 0 ? sheet(point.phase_rad) : -sheet(point.phase_rad);
  }
  return rounds == 0;
}

// The phase margin: 180 degrees and the phase. In a stable loop L may have gone round on its way there, where |L| < 1;
// then from the nearest of the odd multiples of -180 degrees.
double margin_deg_at(const AxisPoint& point, bool is_stable) {
  const double margin_deg = 180 + point.phase_rad * kDegPerRad;
  return is_stable && margin_deg <= -180 ? std::remainder(margin_deg, 360) : margin_deg;
}

void describe_gain_crossovers(Margins& result, const LoopOnAxis& loop, std::span<const double> crossovers) {
  for (const double log_omega : crossovers) {
    const AxisPoint point = loop.at(log_omega);
    const double omega_rad_s = std::exp(log_omega), margin_deg = margin_deg_at(point, result.is_closed_loop_stable);
    result.gain_crossovers_rad_s.push_back(omega_rad_s);
    if (result.phase_margin_deg && *result.phase_margin_deg <= margin_deg) continue;
    result.gain_crossover_rad_s = omega_rad_s;
    result.phase_margin_deg = margin_deg;
    result.phase_slope_deg_per_rad_s = point.log_slope.imag() / omega_rad_s * kDegPerRad;
  }
}

// Without a dead time all are listed; with one, of those at small |L| only the first if there is no other.
void describe_phase_crossovers(Margins& result, const OpenLoop& loop, const LoopOnAxis& on_axis,
                               std::span<const double> crossovers) {
  for (const double log_omega : crossovers) {
    const double log_gain = on_axis.at(log_omega).log_magnitude, margin_db = -log_gain * kDbPerNeper;
    const bool is_listed = loop.plant.dead_time_s == 0 || log_gain > kListedLogGain;
    if (is_listed || result.phase_crossovers_rad_s.empty()) {
      result.phase_crossovers_rad_s.push_back(std::exp(log_omega));
    }
    if (!result.gain_margin_db || std::abs(margin_db) < std::abs(*result.gain_margin_db)) {
      result.gain_margin_db = margin_db;
    }
  }
}

}  // namespace

void check(const OpenLoop& loop) {
  check(loop.plant);
  check(loop.controller);
}

Complex open_loop_response(const OpenLoop& loop, double omega_rad_s) {
  check_frequency(omega_rad_s);
  return LoopOnAxis{loop}.at(std::log(omega_rad_s)).value;  // (1), (2)
}

double open_loop_phase_rad(const OpenLoop& loop, double omega_rad_s) {
  check_frequency(omega_rad_s);
  return LoopOnAxis{loop}.at(std::log(omega_rad_s)).phase_rad;  // (3)
}

double open_loop_phase_slope_s(const OpenLoop& loop, double omega_rad_s) {
  check_frequency(omega_rad_s);
  return LoopOnAxis{loop}.at(std::log(omega_rad_s)).log_slope.imag() / omega_rad_s;  // (4)
}

std::vector<BodePoint> bode(const OpenLoop& loop, std::span<const double> omega_rad_s) {
  check(loop);
  const LoopOnAxis on_axis{loop};
  std::vector<BodePoint> points;
  points.reserve(omega_rad_s.size());
  for (const double omega : omega_rad_s) {
    check_frequency(omega);
    const AxisPoint point = on_axis.at(std::log(omega));
    points.push_back({omega, point.log_magnitude * kDbPerNeper, point.phase_rad * kDegPerRad});
  }
  return points;
}

std::vector<double> log_spaced(double first_rad_s, double last_rad_s, int count) {
  check_frequency(first_rad_s);
  check_frequency(last_rad_s);
  if (!(last_rad_s > first_rad_s && count >= 2)) {
    base::throw_invalid("frequencies: need at least 2 from low to high, not ", count, " from ", first_rad_s, " to ",
                        last_rad_s, " rad/s");
  }
  const double first = std::log(first_rad_s), step = (std::log(last_rad_s) - first) / (count - 1);
  std::vector<double> frequencies(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) frequencies[static_cast<std::size_t>(i)] = std::exp(first + step * i);
  frequencies.front() = first_rad_s;
  frequencies.back() = last_rad_s;
  return frequencies;
}

Margins margins(const OpenLoop& loop) {
  check(loop);
  const LoopOnAxis on_axis{loop};
  const std::vector<Sample> samples = scan(loop, on_axis);
  std::vector<double> crossovers = find_gain_crossovers(on_axis, samples);
  const std::vector<double> phase_crossovers = find_phase_crossovers(loop, on_axis, samples);
  Margins result;
  result.is_closed_loop_stable = is_stable(loop, on_axis, samples, crossovers);
  describe_gain_crossovers(result, on_axis, crossovers);
  describe_phase_crossovers(result, loop, on_axis, phase_crossovers);
  crossovers.insert(crossovers.end(), phase_crossovers.begin(), phase_crossovers.end());
  find_peaks(result, loop, on_axis, samples, crossovers);
  return result;
}

}  // namespace control
