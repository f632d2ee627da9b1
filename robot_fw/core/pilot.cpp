// Keeps the order in force and lets it run out.
#include "robot_fw/core/pilot.hpp"

#include <algorithm>
#include <cmath>

#include "robot_fw/core/saturate.hpp"

namespace robot_fw {
namespace {

constexpr float kArrivedM = 0.002F;  // from the setpoint; twice as far it has left
constexpr int kArrivalTicks = 50;

std::uint64_t after_us(float seconds, std::uint64_t now_us) {
  return now_us + saturated<std::uint64_t>(seconds * 1e6F);
}

std::uint64_t lease_end_us(std::uint32_t lease_ms, std::uint64_t now_us) {
  return now_us + std::uint64_t{lease_ms == 0 ? protocol::kLeaseMs : lease_ms} * 1000;
}

}  // namespace

void Pilot::end_motion() {
  manual_duty_ = 0;
  lease_until_us_ = 0;
  schedule_size_ = schedule_next_ = 0;
  schedule_tick_ = 0;
}

void Pilot::halt() {
  end_motion();
  setpoint_m_.reset();
  delivery_m_.reset();
  alone_until_us_ = 0;
  arrived_ = false;
  near_ticks_ = 0;
  disturbance_m_ = 0;
  lease_lapsed_ = false;
}

void Pilot::enter_auto(float setpoint_m, float limit_s, std::uint64_t now_us) {
  halt();
  setpoint_m_ = setpoint_m;
  auto_limit_s_ = limit_s;
  auto_until_us_ = after_us(limit_s, now_us);
}

void Pilot::set_setpoint(float setpoint_m) {
  setpoint_m_ = setpoint_m;
  delivery_m_.reset();
  arrived_ = false;
  near_ticks_ = 0;
}

void Pilot::start_delivery(float position_m, float limit_s, std::uint64_t now_us) {
  delivery_m_ = position_m;
  delivery_since_us_ = now_us;
  delivery_until_us_ = after_us(limit_s, now_us);
  arrived_ = false;
  near_ticks_ = 0;
}

float Pilot::end_delivery(std::uint64_t now_us) {
  delivery_m_.reset();
  return static_cast<float>(now_us - delivery_since_us_) * 1e-6F;
}

void Pilot::outlive_link(float limit_s, std::uint64_t now_us) { alone_until_us_ = after_us(limit_s, now_us); }

bool Pilot::arrival_changed(float position_m) {
  if (!is_auto() || delivering()) return false;
  const float off_m = std::fabs(*setpoint_m_ - position_m);
  near_ticks_ = off_m <= kArrivedM ? std::min(near_ticks_ + 1, kArrivalTicks) : 0;
  const bool was = arrived_;
  arrived_ = arrived_ ? off_m <= 2 * kArrivedM : near_ticks_ == kArrivalTicks;
  return arrived_ != was;
}

protocol::SubState Pilot::sub_state() const {
  if (!is_auto()) return rheonaut_SUB_STATE_NONE;
  if (delivering()) return rheonaut_SUB_STATE_DELIVERING;
  return arrived_ ? rheonaut_SUB_STATE_HOLDING : rheonaut_SUB_STATE_NAVIGATING;
}

void Pilot::set_duty(float duty, std::uint32_t lease_ms, std::uint64_t now_us) {
  end_motion();
  lease_lapsed_ = false;
  manual_duty_ = duty;
  if (duty != 0) lease_until_us_ = lease_end_us(lease_ms, now_us);
}

void Pilot::set_schedule(const rheonaut_SetDutySchedule& schedule, std::uint64_t now_us) {
  end_motion();
  lease_lapsed_ = false;
  for (std::size_t i = 0; i < schedule.tick_count; ++i) schedule_[i] = {schedule.tick[i], schedule.duty[i]};
  schedule_size_ = schedule.tick_count;
  lease_until_us_ = lease_end_us(0, now_us);
}

bool Pilot::renew_lease(std::uint32_t lease_ms, std::uint64_t now_us) {
  if (lease_until_us_ == 0 || lease_lapses(now_us)) return false;  // SAFETY: what has lapsed stays lapsed
  lease_until_us_ = lease_end_us(lease_ms, now_us);
  return true;
}

Pilot::Lapse Pilot::tick(std::uint64_t now_us) {
  if (is_auto()) {
    if (alone_until_us_ != 0 && now_us >= alone_until_us_) return Lapse::link_loss;
    if (now_us >= auto_until_us_) return Lapse::auto_limit;
    return delivering() && now_us >= delivery_until_us_ ? Lapse::delivery_limit : Lapse::none;
  }
  if (!motion_ordered()) return Lapse::none;
  if (lease_lapses(now_us)) {
    end_motion();  // SAFETY: a manual duty or schedule that nobody renews ends
    lease_lapsed_ = true;
    return Lapse::lease;
  }
  return schedule_size_ > 0 && follow_schedule() ? Lapse::schedule : Lapse::none;
}

// Takes the duty due at this tick; true when that was the last entry.
bool Pilot::follow_schedule() {
  while (schedule_next_ < schedule_size_ && schedule_[schedule_next_].tick <= schedule_tick_) {
    manual_duty_ = schedule_[schedule_next_++].duty;
  }
  ++schedule_tick_;
  if (schedule_next_ < schedule_size_) return false;
  end_motion();  // the last entry is 0
  return true;
}

}  // namespace robot_fw
