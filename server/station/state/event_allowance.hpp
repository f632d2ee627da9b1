// Bounds how many events of one robot are recorded: a burst, and then so many a second. The others are counted.
//
// Events of safety have an allowance of their own, so that no flood of others keeps them out. Plain bookkeeping; times
// are the caller's, steady.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>

#include "protocol/messages.hpp"

namespace server::station {

// Of what stopped the robot, or may move it again, and what it can no longer do.
constexpr bool is_of_safety(protocol::EventKind kind) {
  switch (kind) {
    case rheonaut_EVENT_KIND_BOOT:
    case rheonaut_EVENT_KIND_EMERGENCY:
    case rheonaut_EVENT_KIND_EMERGENCY_CLEARED:
    case rheonaut_EVENT_KIND_LINK_LOST:
    case rheonaut_EVENT_KIND_LEASE_LAPSED:
    case rheonaut_EVENT_KIND_SENSOR_FAULT:
    case rheonaut_EVENT_KIND_AUTO_LIMIT:
    case rheonaut_EVENT_KIND_POSITION_UNCERTAIN: return true;
    default: return false;
  }
}

class EventAllowance {
 public:
  static constexpr std::int64_t kBurst = 1000;
  static constexpr std::int64_t kASecond = 50;  // a setpoint each 20 ms
  static constexpr std::int64_t kReportPeriodUs = 10'000'000;

  // Those that were left out since the last report.
  struct LeftOut {
    std::uint64_t count = 0;
    std::int64_t first_us = 0, last_us = 0;  // steady
  };

  // False: it is too many.
  bool take(protocol::EventKind kind, std::int64_t now_us) {
    std::int64_t& full_at_us = is_of_safety(kind) ? safety_full_at_us_ : others_full_at_us_;
    const std::int64_t next_us = std::max(full_at_us, now_us) + kOneEachUs;
    if (next_us - now_us > kBurst * kOneEachUs) return false;
    full_at_us = next_us;
    return true;
  }

  void count_left_out(std::int64_t now_us) {
    if (left_out_.count++ == 0) left_out_.first_us = now_us;
    left_out_.last_us = now_us;
  }

  // What is to be reported: a period after the first that was left out, or at once; none when none was.
  std::optional<LeftOut> report(std::int64_t now_us, bool at_once) {
    const bool is_due = at_once || now_us - left_out_.first_us >= kReportPeriodUs;
    if (left_out_.count == 0 || !is_due) return std::nullopt;
    return std::exchange(left_out_, {});
  }

 private:
  static constexpr std::int64_t kOneEachUs = 1'000'000 / kASecond;

  std::int64_t safety_full_at_us_ = 0, others_full_at_us_ = 0;  // when the whole burst is there again
  LeftOut left_out_;
};

}  // namespace server::station
