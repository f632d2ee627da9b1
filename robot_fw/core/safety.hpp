// The emergency latch, the position limits, the time at power, and the final limit of the duty.
//
// Each stop gives the latch a new id. A clear names an id, so it can never reset a later stop.
#pragma once

#include <cstdint>

#include "protocol/messages.hpp"

namespace robot_fw {

struct DutyRange {
  float min = -1;  // in [-1, 0]
  float max = 1;   // in (0, 1]

  bool contains(float duty) const { return duty >= min && duty <= max; }  // false for NaN
};

struct PositionLimits {
  float min_m = -100;
  float max_m = 100;

  bool contain(float position_m) const { return position_m >= min_m && position_m <= max_m; }
};

struct PowerLimit {
  float duty = 0.9F;  // above this |duty| the motor is at power
  float time_s = 60;  // for at most this long
};

class Safety {
 public:
  Safety(DutyRange range, std::uint64_t boot_id);

  // Latches under a new id, also when latched already.
  void latch(protocol::EmergencyCause cause);
  // Takes over a latch that outlived a reset.
  void restore(std::uint64_t emergency_id, protocol::EmergencyCause cause);
  // Unlatches if `emergency_id` is the one in force; says whether it did.
  bool clear(std::uint64_t emergency_id);

  // Follows the position; says so in the tick in which it leaves the limits.
  bool leaves_limits(float position_m, const PositionLimits& limits);
  // How well the position is known: says in which directions a limit is nearer than that. `margin_m`: 2 sd.
  void watch_certainty(float position_m, float margin_m, const PositionLimits& limits);
  // Outside the limits, the duty that leads further out.
  bool outward(float duty) const;
  // The duty that leads towards a limit which is nearer than the position is known.
  bool uncertain(float duty) const { return (duty > 0 && uncertain_above_) || (duty < 0 && uncertain_below_); }
  bool outside_limits() const { return side_ != Side::inside; }
  // Counts the time at power, which goes down again as fast as it went up; says when it is too much.
  bool too_long_at_power(float duty, float dt_s, const PowerLimit& limit);

  bool latched() const { return emergency_id_ != 0; }
  std::uint64_t emergency_id() const { return emergency_id_; }
  protocol::EmergencyCause cause() const { return cause_; }
  // Whether a sensor caused this emergency, or a stop before it that was not cleared.
  bool has_sensor_cause() const { return has_sensor_cause_; }
  const DutyRange& range() const { return range_; }

  // What the motor gets of the duty wanted: 0 when latched, not finite, outward or uncertain, otherwise within the
  // range.
  float permit(float wanted_duty) const;

 private:
  void take_cause(protocol::EmergencyCause cause);

  enum class Side { inside, below, above };

  DutyRange range_;
  std::uint64_t boot_id_;
  std::uint64_t stops_ = 0;
  std::uint64_t emergency_id_ = 0;
  protocol::EmergencyCause cause_ = rheonaut_EMERGENCY_CAUSE_NONE;
  bool has_sensor_cause_ = false;
  Side side_ = Side::inside;
  bool uncertain_above_ = false, uncertain_below_ = false;
  float at_power_s_ = 0;
};

}  // namespace robot_fw
