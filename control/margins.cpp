// Scans for crossovers and peaks, and polishes them.
#include "control/margins.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "control/frequency_response.hpp"
#include "control/invalid_argument.hpp"

namespace control {
namespace {

using std::numbers::pi;

constexpr double kDbPerNeper = 20 / std::numbers::ln10;
constexpr double kScanStep = 0.2;        // in ln ω; a power law has no feature narrower than about 1
constexpr double kAsymptoteStep = 0.6;   // far from every break
constexpr double kResonanceStep = 0.06;  // near where D or C may resonate
constexpr double kResonanceReach = 2;
constexpr double kBeyond = 9.2;     // ln 1e4: how far the scan goes past the outermost break
constexpr double kAsymptote = 2.1;  // ln 8: |L| is that near to its asymptote past the breaks, or nearer
constexpr double kSlightest = -14;  // ln 1e-6: changes of |L| that are not worth a longer scan
constexpr int kPeaksPolished = 3;

void check_frequency(double omega_rad_s) {
  if (omega_rad_s > 0 && std::isfinite(omega_rad_s)) return;
  throw_invalid("frequency must be positive and finite, is ", omega_rad_s, " rad/s");
}

class LoopOnAxis {
 public:
  explicit LoopOnAxis(const OpenLoop& loop) : plant_{loop.plant, loop.is_velocity_loop}, controller_{loop.controller} {}
  AxisPoint at(double log_omega) const { return plant_.at(log_omega) * controller_.at(log_omega); }

 private:
  PlantOnAxis plant_;
  ControllerOnAxis controller_;
};

struct Sample {
  double log_omega = 0;
  AxisPoint loop;
};

// One real quantity along the axis, with its slope in ln ω.
struct ValueAndSlope {
  double value = 0, slope = 0;
};

ValueAndSlope log_gain(const AxisPoint& point) { return {point.log_magnitude, point.log_slope.real()}; }
ValueAndSlope phase_above_minus_pi(const AxisPoint& point) { return {point.phase_rad + pi, point.log_slope.imag()}; }

// How |L| ends on the right: |L| → e^log_gain · ω^slope.
struct Asymptote {
  double log_gain = 0, slope = 0;
};

double log_dc_gain(const OpenLoop& loop) {
  return std::log(std::abs(loop.plant.kp) * loop.controller.kp / loop.plant.b3);
}

Asymptote right_asymptote(const OpenLoop& loop) {
  const auto& [kp, b1, b2, b3, alpha, beta] = loop.plant;
  const auto& [controller_kp, kd, mu] = loop.controller;
  const double order = (b1 > 0 ? alpha : beta) + (loop.is_velocity_loop ? 0 : 1);
  return {std::log(std::abs(kp) * controller_kp * (kd > 0 ? kd : 1) / (b1 > 0 ? b1 : b2)), (kd > 0 ? mu : 0) - order};
}

struct LogRange {
  double low = 0, high = 0;
  void include(double log_omega) { low = std::min(low, log_omega), high = std::max(high, log_omega); }
};

// The frequencies at which two terms of D or of C are equal: between and near them |L| bends.
LogRange range_of_breaks(const OpenLoop& loop) {
  const auto& [kp, b1, b2, b3, alpha, beta] = loop.plant;
  LogRange range{std::log(b3 / b2) / beta, std::log(b3 / b2) / beta};
  if (b1 > 0) range.include(std::log(b2 / b1) / (alpha - beta));
  if (b1 > 0) range.include(std::log(b3 / b1) / alpha);
  if (loop.controller.kd > 0) range.include(-std::log(loop.controller.kd) / loop.controller.mu);
  return range;
}

// From below the lowest to above the highest frequency where anything happens: the asymptotes may reach 1 far away.
LogRange range_to_scan(const OpenLoop& loop, LogRange range) {
  const double beta = loop.plant.beta, dc = log_dc_gain(loop);
  const auto& [kp, kd, mu] = loop.controller;
  const double lowest_break = range.low;
  if (!loop.is_velocity_loop) {
    range.include(dc);  // |L| ≈ K/ω on the left
  } else if (dc != 0) {
    range.include(lowest_break +
                  std::min(0.0, std::log(std::abs(dc))) / std::min(beta, mu));  // leaves K ≈ 1 that far down
  }
  if (loop.is_velocity_loop && kd > 0 && mu != beta) {
    const double turn = std::log(kd * loop.plant.b3 / loop.plant.b2) / (beta - mu);  // leaves K up, and turns down
    if (std::log(kd) + mu * turn > kSlightest) range.include(turn);
  }
  const Asymptote right = right_asymptote(loop);
  if (right.slope != 0) range.include(-right.log_gain / right.slope + kAsymptote / std::abs(right.slope));
  return {std::clamp(range.low - kBeyond, -kLargestLogOmega, kLargestLogOmega - 1),
          std::clamp(range.high + kBeyond, 1 - kLargestLogOmega, kLargestLogOmega)};
}

// Where D (alpha near 2, b2 small) and C (mu above 1) may have sharp turns; 0 rad/s where they cannot.
struct Resonances {
  double plant = -HUGE_VAL, controller = -HUGE_VAL;
};

Resonances possible_resonances(const OpenLoop& loop) {
  Resonances result;
  if (loop.plant.b1 > 0) result.plant = std::log(loop.plant.b3 / loop.plant.b1) / loop.plant.alpha;
  const auto& [kp, kd, mu] = loop.controller;
  if (kd > 0 && mu > 1) result.controller = -std::log(kd) / mu;
  return result;
}

std::vector<Sample> scan(const OpenLoop& loop, const LoopOnAxis& on_axis) {
  const LogRange breaks = range_of_breaks(loop), range = range_to_scan(loop, breaks);
  const Resonances resonances = possible_resonances(loop);
  const auto step_at = [&](double log_omega) {
    const double away = std::min(std::abs(log_omega - resonances.plant), std::abs(log_omega - resonances.controller));
    if (away < kResonanceReach) return kResonanceStep;
    return log_omega > breaks.low - kBeyond && log_omega < breaks.high + kBeyond ? kScanStep : kAsymptoteStep;
  };
  std::vector<Sample> samples;
  for (double log_omega = range.low; log_omega < range.high; log_omega += step_at(log_omega)) {
    samples.push_back({log_omega, on_axis.at(log_omega)});
  }
  samples.push_back({range.high, on_axis.at(range.high)});
  return samples;
}

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

// Every ln ω where the quantity is 0. Between two samples of one sign it may come to 0 and turn back: the slopes tell.
std::vector<double> zeros(const LoopOnAxis& loop, const std::vector<Sample>& samples,
                          ValueAndSlope (*quantity)(const AxisPoint&)) {
  const auto f = [&](double log_omega) { return quantity(loop.at(log_omega)); };
  std::vector<double> found;
  for (std::size_t i = 0; i + 1 < samples.size(); ++i) {
    const double left = samples[i].log_omega, right = samples[i + 1].log_omega;
    const ValueAndSlope a = quantity(samples[i].loop), b = quantity(samples[i + 1].loop);
    if (a.value == 0) {
      found.push_back(left);
    } else if (a.value * b.value < 0) {
      found.push_back(root_between(left, right, f));
    } else if (a.value * a.slope < 0 && b.value * b.slope > 0) {
      const double turn = extremum_between(left, right, f);
      if (f(turn).value * a.value >= 0) continue;
      found.push_back(root_between(left, turn, f));
      found.push_back(root_between(turn, right, f));
    }
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
  return std::copysign(std::exp(right.log_gain), loop.plant.kp);
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
  include(left_limit(loop), samples.front().log_omega);
  include(right_limit(loop), samples.back().log_omega);
  result.ms = s.value, result.ms_at_rad_s = std::exp(s.log_omega);
  result.mt = t.value, result.mt_at_rad_s = std::exp(t.log_omega);
}

void describe_gain_crossovers(Margins& result, const LoopOnAxis& loop, std::span<const double> crossovers) {
  for (const double log_omega : crossovers) {
    const AxisPoint point = loop.at(log_omega);
    const double omega_rad_s = std::exp(log_omega), margin_deg = 180 + point.phase_rad * kDegPerRad;
    result.gain_crossovers_rad_s.push_back(omega_rad_s);
    if (result.phase_margin_deg && *result.phase_margin_deg <= margin_deg) continue;
    result.gain_crossover_rad_s = omega_rad_s;
    result.phase_margin_deg = margin_deg;
    result.phase_slope_deg_per_rad_s = point.log_slope.imag() / omega_rad_s * kDegPerRad;
  }
}

// The plant is stable, so 1 + L has no zero on the right exactly if L does not go round -1: as often up as down
// through the axis on the left of it. A negative gain adds one passage at ω = 0, which nothing balances.
void describe_phase_crossovers(Margins& result, const OpenLoop& loop, const LoopOnAxis& on_axis,
                               std::span<const double> crossovers) {
  int rounds = 0;
  for (const double log_omega : crossovers) {
    const AxisPoint point = on_axis.at(log_omega);
    const double margin_db = -point.log_magnitude * kDbPerNeper;
    result.phase_crossovers_rad_s.push_back(std::exp(log_omega));
    if (margin_db < 0) rounds += point.log_slope.imag() < 0 ? 1 : -1;
    if (!result.gain_margin_db || std::abs(margin_db) < std::abs(*result.gain_margin_db)) {
      result.gain_margin_db = margin_db;
    }
  }
  const bool passes_at_0 = loop.plant.kp < 0 && (!loop.is_velocity_loop || log_dc_gain(loop) > 0);
  result.is_closed_loop_stable = rounds == 0 && !passes_at_0;
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
    throw_invalid("frequencies: need at least 2 from low to high, not ", count, " from ", first_rad_s, " to ",
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
  std::vector<double> crossovers = zeros(on_axis, samples, log_gain);
  const std::vector<double> phase_crossovers = zeros(on_axis, samples, phase_above_minus_pi);
  Margins result;
  describe_gain_crossovers(result, on_axis, crossovers);
  describe_phase_crossovers(result, loop, on_axis, phase_crossovers);
  crossovers.insert(crossovers.end(), phase_crossovers.begin(), phase_crossovers.end());
  find_peaks(result, loop, on_axis, samples, crossovers);
  return result;
}

}  // namespace control
