#include "server/experiments/duty_signals.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "control/identification/planned_experiment.hpp"

namespace server::experiments {
namespace {

std::uint64_t ticks_in(double time_s) { return static_cast<std::uint64_t>(std::llround(time_s / kTick_s)); }

void change(std::vector<DutyChange>& changes, std::uint64_t tick, double duty) {
  if (changes.empty() || changes.back().duty != duty) changes.push_back({tick, duty});
}

// Calls value_at(time of the hold's beginning) for each hold.
template <class ValueAt>
std::vector<DutyChange> held(const Step& step, const ValueAt& value_at) {
  const std::uint64_t hold = std::max<std::uint64_t>(1, ticks_in(step.every_s));
  std::vector<DutyChange> changes;
  for (std::uint64_t tick = 0; tick < ticks_of(step); tick += hold) {
    change(changes, tick, value_at(static_cast<double>(tick) * kTick_s));
  }
  return changes;
}

std::vector<DutyChange> staircase(const Step& step) {
  std::vector<DutyChange> changes;
  const std::uint64_t total = ticks_of(step);
  for (std::uint64_t level = 0; level < step.levels; ++level) {
    const double share = static_cast<double>(level) / static_cast<double>(step.levels - 1);
    change(changes, level * total / step.levels, std::lerp(step.from_duty, step.to_duty, share));
  }
  return changes;
}

std::vector<DutyChange> chirp(const Step& step) {
  const double growth_s = step.for_s / std::log(step.to_hz / step.from_hz);
  return held(step, [&](double time_s) {
    const double phase = 2 * std::numbers::pi * step.from_hz * growth_s * std::expm1(time_s / growth_s);  // (1)
    return step.mean_duty + step.amplitude * std::sin(phase);
  });
}

std::vector<DutyChange> multisine(const Step& step) {
  const std::vector<double> frequencies_hz = tone_frequencies_hz(step);
  const auto tones = static_cast<double>(frequencies_hz.size());
  std::vector<DutyChange> changes = held(step, [&](double time_s) {
    double sum = 0;
    for (std::size_t i = 0; i < frequencies_hz.size(); ++i) {
      const auto k = static_cast<double>(i + 1);
      const double phase = std::numbers::pi * k * (k - 1) / tones;
      sum += std::cos(2 * std::numbers::pi * frequencies_hz[i] * time_s - phase);  // (2)
    }
    return sum;
  });
  double peak = 0;
  for (const DutyChange& each : changes) peak = std::max(peak, std::abs(each.duty));
  for (DutyChange& each : changes) each.duty = step.mean_duty + step.amplitude * (peak > 0 ? each.duty / peak : 0);
  return changes;
}

std::vector<DutyChange> prbs(const Step& step) {
  std::vector<DutyChange> changes;
  const std::vector<double> duty = control::prbs_duty(step.amplitude, step.bit_s, step.for_s, kTick_s);
  // Without its last value, which is that of the end: there the next step begins.
  for (std::uint64_t tick = 0; tick < ticks_of(step); ++tick) change(changes, tick, step.mean_duty + duty.at(tick));
  return changes;
}

}  // namespace

std::uint64_t ticks_of(const Step& step) { return ticks_in(step.for_s); }

std::vector<double> tone_frequencies_hz(const Step& step) {
  std::vector<double> frequencies_hz;
  for (std::uint64_t i = 0; i < step.tones; ++i) {
    const double share = step.tones == 1 ? 0 : static_cast<double>(i) / static_cast<double>(step.tones - 1);
    const double periods = std::round(step.for_s * step.from_hz * std::pow(step.to_hz / step.from_hz, share));
    const double frequency_hz = std::max(periods, 1.0) / step.for_s;
    if (frequencies_hz.empty() || frequency_hz > frequencies_hz.back()) frequencies_hz.push_back(frequency_hz);
  }
  return frequencies_hz;
}

std::vector<DutyChange> duty_changes(const Step& step) {
  switch (step.kind) {
    case StepKind::rest: return {{0, 0}};
    case StepKind::duty: return {{0, step.duty}};
    case StepKind::staircase: return staircase(step);
    case StepKind::ramp:
      return held(step, [&](double time_s) { return std::lerp(step.from_duty, step.to_duty, time_s / step.for_s); });
    case StepKind::chirp: return chirp(step);
    case StepKind::prbs: return prbs(step);
    case StepKind::multisine: return multisine(step);
    case StepKind::setpoint:
    case StepKind::disturbance:
    case StepKind::scan:
    case StepKind::tones: break;
  }
  return {};
}

}  // namespace server::experiments
