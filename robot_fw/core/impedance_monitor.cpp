// Counts readings outside and inside the bands.
#include "robot_fw/core/impedance_monitor.hpp"

#include <algorithm>
#include <cmath>

namespace robot_fw {
namespace {

constexpr int kEntryReadings = 5;
constexpr int kExitReadings = 50;
constexpr int kArmingReadings = 50;

}  // namespace

bool ImpedanceMonitor::step(float impedance_mv, bool usable, bool in_place, const ImpedanceRules& rules) {
  const float off_mv = std::fabs(impedance_mv - rules.nominal_mv);
  const bool outside = usable && off_mv > rules.band_mv;
  inside_ = usable && !outside ? std::min(inside_ + 1, kArmingReadings) : 0;
  if (inside_ == kArmingReadings) armed_ = true;
  if (!usable || off_mv > rules.exit_band_mv) {
    mixed_ = 0;
  } else if (in_place) {
    mixed_ = std::min(mixed_ + 1, kExitReadings);
  }
  outside_ = outside && armed_ ? outside_ + 1 : 0;
  if (outside_ < kEntryReadings) return false;
  outside_ = mixed_ = 0;
  armed_ = false;
  return true;
}

bool ImpedanceMonitor::mixed() const { return mixed_ == kExitReadings; }

}  // namespace robot_fw
