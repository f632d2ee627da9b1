// Bounds how many events and connections of one robot are recorded: a burst, and then one in each period. The others
// are counted.
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

// Whether the event is about a stop of the robot, its moving again, or a loss of something that it could do.
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

// A burst, and then one in each period.
class Allowance {
 public:
  constexpr Allowance(std::int64_t burst, std::int64_t period_us) : burst_{burst}, period_us_{period_us} {}

  // False: it is too many.
  bool take(std::int64_t now_us) {
    const std::int64_t next_us = std::max(full_at_us_, now_us) + period_us_;
    if (next_us - now_us > burst_ * period_us_) return false;
    full_at_us_ = next_us;
    return true;
  }

 private:
  std::int64_t burst_, period_us_;
  std::int64_t full_at_us_ = 0;  // when the whole burst is there again
};

class EventAllowance {
 public:
  static constexpr std::int64_t kBurst = 1000;
  static constexpr std::int64_t kASecond = 50;  // a setpoint each 20 ms

  bool take(protocol::EventKind kind, std::int64_t now_us) {
    return (is_of_safety(kind) ? safety_ : others_).take(now_us);
  }

 private:
  static constexpr std::int64_t kOneEachUs = 1'000'000 / kASecond;

  Allowance safety_{kBurst, kOneEachUs}, others_{kBurst, kOneEachUs};
};

// A connection is recorded with its beginning and its end, or not at all.
class ConnectionAllowance {
 public:
  static constexpr std::int64_t kBurst = 60;
  static constexpr std::int64_t kAMinute = 30;

  bool take(std::int64_t now_us) { return connections_.take(now_us); }

 private:
  Allowance connections_{kBurst, 60'000'000 / kAMinute};
};

// Counts those that were left out since the last report.
class LeftOutCount {
 public:
  static constexpr std::int64_t kReportPeriodUs = 10'000'000;

  struct Report {
    std::uint64_t count = 0;
    std::int64_t first_us = 0, last_us = 0;  // steady
  };

  void add(std::int64_t now_us) {
    if (left_out_.count++ == 0) left_out_.first_us = now_us;
    left_out_.last_us = now_us;
  }

  // What is to be reported: a period after the first that was left out, or at once; none when none was.
  std::optional<Report> report(std::int64_t now_us, bool at_once) {
    const bool is_due = at_once || now_us - left_out_.first_us >= kReportPeriodUs;
    if (left_out_.count == 0 || !is_due) return std::nullopt;
    return std::exchange(left_out_, {});
  }

 private:
  Report left_out_;
};

}  // namespace server::station
