// Holds the duty until the motor goes off, draws lines through positions and velocities, and marks what was not
// measured.
#include "control/search/missed_ticks.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/invalid_argument.hpp"

namespace control {
namespace {

enum class Fill { hold, line };

std::vector<double> filled(const std::vector<double>& values, std::span<const std::size_t> ticks, Fill fill) {
  std::vector<double> all;
  if (values.empty()) return all;
  all.reserve(ticks.back() + 1);
  for (std::size_t k = 0; k + 1 < values.size(); ++k) {
    const std::size_t steps = ticks[k + 1] - ticks[k];
    const double slope = fill == Fill::line ? (values[k + 1] - values[k]) / static_cast<double>(steps) : 0;
    for (std::size_t i = 0; i < steps; ++i) all.push_back(values[k] + slope * static_cast<double>(i));
  }
  all.push_back(values.back());
  return all;
}

// A period in which the motor goes off has the mean of its duty.
std::vector<double> duty_of_motor(const std::vector<double>& duty, std::span<const std::size_t> ticks, double dt_s) {
  std::vector<double> all = filled(duty, ticks, Fill::hold);
  for (std::size_t k = 0; k + 1 < ticks.size(); ++k) {
    for (std::size_t tick = ticks[k] + 1; tick < ticks[k + 1]; ++tick) {
      const double held_s = kMotorOffS - dt_s * static_cast<double>(tick - ticks[k]);
      all[tick] *= std::clamp(held_s / dt_s, 0.0, 1.0);
    }
  }
  return all;
}

}  // namespace

double most_missed_in_a_row(double dt_s) {
  constexpr double kRounding = 0.01;  // of a period: stored times are rounded
  return std::floor(kLongestMissedS / dt_s + kRounding);
}

bool may_be_missed(std::size_t missed, std::size_t ticks) {
  return static_cast<double>(missed) <= kMostMissedShare * static_cast<double>(ticks);
}

void place_at_ticks(Recording& recording, std::span<const std::size_t> ticks) {
  if (ticks.empty() || ticks.back() + 1 == ticks.size()) return;
  recording.duty = duty_of_motor(recording.duty, ticks, recording.dt_s);
  recording.velocity_m_s = filled(recording.velocity_m_s, ticks, Fill::line);
  recording.acceleration_m_s2 = filled(recording.acceleration_m_s2, ticks, Fill::hold);
  if (recording.position_time_s.empty()) recording.position_m = filled(recording.position_m, ticks, Fill::line);
  recording.is_missed.assign(recording.duty.size(), true);
  for (const std::size_t tick : ticks) recording.is_missed[tick] = false;
}

std::size_t missed_ticks(const Recording& recording) {
  return static_cast<std::size_t>(std::ranges::count(recording.is_missed, true));
}

std::vector<bool> uncounted_ticks(const Recording& recording) {
  std::vector<bool> uncounted = recording.is_missed;
  uncounted.resize(std::max(uncounted.size(), recording.is_left_out.size()));
  for (std::size_t k = 0; k < recording.is_left_out.size(); ++k) {
    if (recording.is_left_out[k]) uncounted[k] = true;
  }
  return uncounted;
}

double share_used(std::span<const Recording> recordings) {
  std::size_t ticks = 0, uncounted = 0;
  for (const Recording& recording : recordings) {
    const std::vector<bool> left_out = uncounted_ticks(recording);
    ticks += recording.duty.size();
    uncounted += static_cast<std::size_t>(std::ranges::count(left_out, true));
  }
  return ticks == 0 ? 1 : 1 - static_cast<double>(uncounted) / static_cast<double>(ticks);
}

std::string missed_ticks_in_words(const Recording& recording) {
  const std::size_t missed = missed_ticks(recording), ticks = recording.is_missed.size();
  if (missed == 0) return {};
  const auto first = std::ranges::find(recording.is_missed, true) - recording.is_missed.begin();
  return base::join_text(
      missed, " of ", ticks, " ticks are missing, the first at ", recording.dt_s * static_cast<double>(first),
      " s: the fit leaves them out; the duty before them is assumed to have held for ", 1e3 * kMotorOffS,
      " ms and to have been 0 from then to the next tick, as the board of this "
      "robot turns its motor off");
}

}  // namespace control
