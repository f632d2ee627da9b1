// Where the scan begins and ends, and how fine it is.
#include "control/responses/loop_scan.hpp"

#include <algorithm>
#include <cmath>

namespace control {
namespace {

constexpr double kScanStep = 0.2;        // in ln ω; a power law has no feature narrower than about 1
constexpr double kAsymptoteStep = 0.6;   // far from every break
constexpr double kResonanceStep = 0.06;  // near where D or C may resonate
constexpr double kResonanceReach = 2;
constexpr double kBeyond = 9.2;        // ln 1e4: how far the scan goes past the outermost break
constexpr double kAsymptote = 2.1;     // ln 8: |L| is that near to its asymptote past the breaks, or nearer
constexpr double kSlightest = -14;     // ln 1e-6: changes of |L| that are not worth a longer scan
constexpr double kFirstTurnsRad = 10;  // of a dead time's phase: one passage of the negative axis at least
constexpr double kTurnsUnseen = -9.2;  // ln 1e-4: |L| from which on its turns no longer show in a peak

struct LogRange {
  double low = 0, high = 0;
  void include(double log_omega) { low = std::min(low, log_omega), high = std::max(high, log_omega); }
};

// The frequencies at which two terms of D or of C are equal: between and near them |L| bends.
LogRange range_of_breaks(const OpenLoop& loop) {
  const auto& [kp, b1, b2, b3, alpha, beta, dead_time_s] = loop.plant;
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

// A dead time turns L ever faster: the samples follow it as long as |L| is not yet small for good.
double step_of_turns(const OpenLoop& loop, const LogRange& breaks, const Sample& sample) {
  const double lag_rad = loop.plant.dead_time_s * std::exp(sample.log_omega);
  const bool is_small =
      lag_rad > kFirstTurnsRad && sample.log_omega > breaks.high && sample.loop.log_magnitude < kTurnsUnseen;
  return lag_rad > 0 && lag_rad < kMostTurnsRad && !is_small ? kTurnStepRad / lag_rad : HUGE_VAL;
}

}  // namespace

double log_dc_gain(const OpenLoop& loop) {
  return std::log(std::abs(loop.plant.kp) * loop.controller.kp / loop.plant.b3);
}

Asymptote right_asymptote(const OpenLoop& loop) {
  const auto& [kp, b1, b2, b3, alpha, beta, dead_time_s] = loop.plant;
  const auto& [controller_kp, kd, mu] = loop.controller;
  const double order = (b1 > 0 ? alpha : beta) + (loop.is_velocity_loop ? 0 : 1);
  return {std::log(std::abs(kp) * controller_kp * (kd > 0 ? kd : 1) / (b1 > 0 ? b1 : b2)), (kd > 0 ? mu : 0) - order};
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
  for (double log_omega = range.low; log_omega < range.high;) {
    samples.push_back({log_omega, on_axis.at(log_omega)});
    log_omega += std::min(step_at(log_omega), step_of_turns(loop, breaks, samples.back()));
  }
  samples.push_back({range.high, on_axis.at(range.high)});
  return samples;
}

}  // namespace control
