// What the robot is commanded to do: manual with a duty, or auto with a setpoint.
//
// halt() clears everything here: no setpoint, duty, lease, schedule or disturbance outlives a change of mode, an
// emergency or a lost link.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "protocol/messages.hpp"

namespace robot_fw {

constexpr std::size_t kMaxScheduleEntries = 64;

class Pilot {
 public:
  enum class Lapse { none, lease, schedule, auto_limit, delivery_limit, link_loss };

  // Manual at duty 0 with nothing pending: the state after boot, and the end of every motion.
  void halt();
  // Ends by itself after `limit_s`.
  void enter_auto(float setpoint_m, float limit_s, std::uint64_t now_us);
  // Ends a delivery.
  void set_setpoint(float setpoint_m);
  void set_disturbance(float disturbance_m) { disturbance_m_ = disturbance_m; }
  // A duty of 0 needs no lease and ends one.
  void set_duty(float duty, std::uint32_t lease_ms, std::uint64_t now_us);
  void set_schedule(const rheonaut_SetDutySchedule& schedule, std::uint64_t now_us);
  // Extends a duty or schedule that still runs; false when there is none.
  bool renew_lease(std::uint32_t lease_ms, std::uint64_t now_us);
  // Whether the lease of a duty or schedule has run out, as tick() will report.
  bool lease_lapses(std::uint64_t now_us) const { return lease_until_us_ != 0 && now_us >= lease_until_us_; }

  // In auto: holds `position_m` in place of the setpoint, for at most `limit_s`.
  void start_delivery(float position_m, float limit_s, std::uint64_t now_us);
  // Continues to the setpoint; returns how long it was held.
  float end_delivery(std::uint64_t now_us);
  // In auto: the link is gone, auto ends after `limit_s` unless it comes back.
  void outlive_link(float limit_s, std::uint64_t now_us);
  void link_restored() { alone_until_us_ = 0; }

  // Once per tick, before duty(): returns what has run out. A duty or schedule has ended by then; the caller ends auto
  // and deliveries.
  Lapse tick(std::uint64_t now_us);
  // Once per tick, in auto: whether the robot has reached its setpoint and stays there, or has left it again.
  bool arrival_changed(float position_m);

  bool is_auto() const { return setpoint_m_.has_value(); }
  bool delivering() const { return delivery_m_.has_value(); }
  protocol::SubState sub_state() const;
  std::optional<float> setpoint_m() const { return setpoint_m_; }
  // The position to hold: the setpoint, or where it delivers.
  std::optional<float> target_m() const { return delivery_m_ ? delivery_m_ : setpoint_m_; }
  float disturbance_m() const { return disturbance_m_; }
  float manual_duty() const { return manual_duty_; }
  bool motion_ordered() const { return is_auto() || lease_until_us_ != 0; }
  float auto_limit_s() const { return auto_limit_s_; }
  bool lease_lapsed() const { return lease_lapsed_; }  // since the last order

 private:
  void end_motion();
  bool follow_schedule();

  float auto_limit_s_ = 0;  // of the last entry
  std::uint64_t auto_until_us_ = 0;
  std::optional<float> setpoint_m_;  // present in auto, and only there
  float disturbance_m_ = 0;
  std::optional<float> delivery_m_;
  std::uint64_t delivery_since_us_ = 0, delivery_until_us_ = 0;
  std::uint64_t alone_until_us_ = 0;  // 0: the link is there
  bool arrived_ = false;
  int near_ticks_ = 0;  // at the setpoint, in a row
  float manual_duty_ = 0;
  bool lease_lapsed_ = false;
  std::uint64_t lease_until_us_ = 0;  // 0: neither duty nor schedule runs

  struct Entry {
    std::uint32_t tick;
    float duty;
  };
  std::array<Entry, kMaxScheduleEntries> schedule_{};
  std::size_t schedule_size_ = 0;  // 0: no schedule
  std::size_t schedule_next_ = 0;
  std::uint32_t schedule_tick_ = 0;
};

}  // namespace robot_fw
