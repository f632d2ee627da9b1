// A ring of duties.
#include "control/models/delay_line.hpp"

#include <algorithm>
#include <cmath>

#include "base/invalid_argument.hpp"

namespace control {
namespace {

constexpr double kWhole = 1e-9;  // of a step
constexpr double kMostSteps = 1e6;

}  // namespace

DelayLine::DelayLine(double dead_time_s, double dt_s) {
  const double steps = dead_time_s / dt_s;
  if (!(steps >= 0 && steps <= kMostSteps)) {
    base::throw_invalid("dead time: dead_time_s ", dead_time_s, " must be 0 to 1e6 steps of ", dt_s, " s");
  }
  const double whole = std::floor(steps + kWhole), rest = steps - whole;
  if (rest > kWhole) earlier_share_ = rest;
  duties_.resize(static_cast<std::size_t>(whole) + (earlier_share_ > 0 ? 1 : 0));
}

HeldDuty DelayLine::push(double duty) {
  if (duties_.empty()) return {duty, duty};
  const double earlier = duties_[oldest_];
  duties_[oldest_] = duty;
  oldest_ = (oldest_ + 1) % duties_.size();
  return {earlier, earlier_share_ > 0 ? duties_[oldest_] : earlier};
}

void DelayLine::reset() { std::ranges::fill(duties_, 0.0); }

}  // namespace control
