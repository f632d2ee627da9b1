// Latches, clears and limits.
#include "robot_fw/core/safety.hpp"

#include <algorithm>
#include <cmath>

namespace robot_fw {
namespace {

// splitmix64: neighbouring inputs give unrelated outputs (Steele, Lea and Flood 2014).
std::uint64_t mix(std::uint64_t value) {
  value += 0x9E3779B97F4A7C15U;
  value = (value ^ (value >> 30)) * 0xBF58476D1CE4E5B9U;
  value = (value ^ (value >> 27)) * 0x94D049BB133111EBU;
  return value ^ (value >> 31);
}

constexpr float kReturnM = 0.001F;  // so far inside it is inside again; at the very limit noise would go to and fro

}  // namespace

Safety::Safety(DutyRange range, std::uint64_t boot_id) : range_(range), boot_id_(boot_id) {}

void Safety::latch(protocol::EmergencyCause cause) {
  const std::uint64_t before = emergency_id_;
  do {
    emergency_id_ = mix(boot_id_ ^ mix(++stops_));
  } while (emergency_id_ == 0 || emergency_id_ == before);  // SAFETY: never the id that a clear may name already
  take_cause(cause);
}

void Safety::restore(std::uint64_t emergency_id, protocol::EmergencyCause cause) {
  emergency_id_ = emergency_id;
  take_cause(cause);
}

void Safety::take_cause(protocol::EmergencyCause cause) {
  cause_ = cause;
  has_sensor_cause_ = has_sensor_cause_ || cause == rheonaut_EMERGENCY_CAUSE_SENSOR_MISSING ||
                      cause == rheonaut_EMERGENCY_CAUSE_SENSOR_STUCK ||
                      cause == rheonaut_EMERGENCY_CAUSE_SENSOR_OUT_OF_RANGE;
}

bool Safety::clear(std::uint64_t emergency_id) {
  if (!latched() || emergency_id != emergency_id_) return false;  // SAFETY: a clear never undoes a later stop
  emergency_id_ = 0;
  cause_ = rheonaut_EMERGENCY_CAUSE_NONE;
  has_sensor_cause_ = false;
  return true;
}

bool Safety::leaves_limits(float position_m, const PositionLimits& limits) {
  const Side before = side_;
  if (position_m > limits.max_m) {
    side_ = Side::above;
  } else if (position_m < limits.min_m) {
    side_ = Side::below;
  } else if (position_m <= limits.max_m - kReturnM && position_m >= limits.min_m + kReturnM) {  // NaN is nowhere
    side_ = Side::inside;
  }
  return side_ != Side::inside && side_ != before;
}

void Safety::watch_certainty(float position_m, float margin_m, const PositionLimits& limits) {
  uncertain_above_ = position_m + margin_m > limits.max_m;
  uncertain_below_ = position_m - margin_m < limits.min_m;
}

bool Safety::outward(float duty) const {
  return (side_ == Side::above && duty > 0) || (side_ == Side::below && duty < 0);
}

bool Safety::too_long_at_power(float duty, float dt_s, const PowerLimit& limit) {
  const bool at_power = std::fabs(duty) > limit.duty;
  at_power_s_ = std::clamp(at_power_s_ + (at_power ? dt_s : -dt_s), 0.0F, limit.time_s);
  return at_power && at_power_s_ >= limit.time_s;
}

float Safety::permit(float wanted_duty) const {
  if (latched()) return 0;                          // SAFETY: emergency overrides every mode; it coasts
  if (!std::isfinite(wanted_duty)) return 0;        // SAFETY: no NaN reaches the motor
  if (outward(wanted_duty)) return 0;               // SAFETY: outside a limit only inward
  if (uncertain(wanted_duty)) return 0;             // SAFETY: nor towards one that may have been reached already
  if (wanted_duty < range_.min) return range_.min;  // SAFETY: within the motor's range
  if (wanted_duty > range_.max) return range_.max;
  return wanted_duty;
}

}  // namespace robot_fw
