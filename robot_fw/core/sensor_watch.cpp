// Counts silent, equal, wrong and good readings.
#include "robot_fw/core/sensor_watch.hpp"

#include <algorithm>

namespace robot_fw {
namespace {

constexpr std::int16_t kRecoveryReadings = 50;

void count(std::int16_t& counter, bool more) {
  constexpr std::int16_t kEnough = 30'000;
  counter = more ? static_cast<std::int16_t>(std::min<int>(counter + 1, kEnough)) : std::int16_t{0};
}

}  // namespace

bool SensorWatch::step(float reading, bool is_valid) {
  count(silent_, !is_valid);
  if (is_valid) {
    count(equal_, has_spoken_ && reading == last_);
    has_spoken_ = true;
    count(wrong_, !in_range(reading));
    last_ = reading;
  }
  const SensorFault now = found();
  count(good_, is_valid && now == SensorFault::none && wrong_ == 0);
  const SensorFault before = fault_;
  if (now != SensorFault::none || good_ >= std::max(kRecoveryReadings, rules_.stuck_readings)) fault_ = now;
  return fault_ != before;
}

SensorFault SensorWatch::found() const {
  if (!has_spoken_ || silent_ >= rules_.missing_ticks) return SensorFault::missing;
  if (wrong_ >= rules_.wrong_readings) return SensorFault::out_of_range;
  if (rules_.stuck_readings > 0 && equal_ + 1 >= rules_.stuck_readings) return SensorFault::stuck;
  return SensorFault::none;
}

}  // namespace robot_fw
