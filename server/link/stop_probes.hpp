// Whether an emergency stop would reach a robot now, and how fast: judged by probes that take the way of a stop.
//
// A probe is no command. One is due every 500 ms; the outbox sends it behind stops and ahead of all else. The way is
// open while probes are answered and the robot is not silent. Times are steady µs. Pure, as its owner RobotOutbox.
#pragma once

#include <algorithm>
#include <cstdint>

#include "server/station/state/station_state.hpp"

namespace server::link {

class StopProbes {
 public:
  static constexpr std::int64_t kPeriodUs = 500'000;
  static constexpr std::int64_t kLateUs = 250'000;    // an answer later than this after the probe was due
  static constexpr std::int64_t kSilenceUs = 50'000;  // of the robot, beyond the interval of heartbeats

  explicit StopProbes(std::int64_t heartbeat_interval_us) : silence_us_{heartbeat_interval_us + kSilenceUs} {}

  // From the Welcome on, to a robot that answers probes.
  void begin(std::int64_t now_us) {
    path_.is_measured = true;
    due_us_ = now_us;
  }

  bool is_due(std::int64_t now_us) const { return path_.is_measured && now_us >= due_us_; }
  // The stamp of the probe that is written now.
  std::uint64_t take(std::int64_t now_us) {
    if (stamp_us_ == 0) late_us_ = due_us_ + kLateUs;  // one that could not be written when it was due is late as well
    stamp_us_ = static_cast<std::uint64_t>(std::max<std::int64_t>(now_us, 1));
    due_us_ = now_us + kPeriodUs;
    return stamp_us_;
  }
  // False when it answers none, or another than the latest.
  bool on_answer(std::uint64_t echo_station_time_us, std::int64_t received_us, std::int64_t received_at_utc_us) {
    if (stamp_us_ == 0 || echo_station_time_us != stamp_us_) return false;
    path_.round_trip_us = received_us - static_cast<std::int64_t>(stamp_us_);
    path_.answered_at_us = received_at_utc_us;
    stamp_us_ = 0;
    return true;
  }
  bool awaits_answer() const { return stamp_us_ != 0; }

  // SAFETY: open only while it is shown to be: an answer has come, none is late, and the robot is not silent.
  const station::StopPath& judge(std::int64_t received_us, std::int64_t now_us) {
    path_.is_open = path_.answered_at_us != 0 && now_us < ends_us(received_us);
    return path_;
  }
  std::int64_t due_us() const { return due_us_; }
  // Until when an open way stays open if nothing is received.
  std::int64_t ends_us(std::int64_t received_us) const {
    return std::min(received_us + silence_us_, stamp_us_ != 0 ? late_us_ : due_us_ + kLateUs);
  }

 private:
  station::StopPath path_;
  std::int64_t silence_us_;
  std::int64_t due_us_ = 0;     // the next probe
  std::int64_t late_us_ = 0;    // when the awaited answer is late
  std::uint64_t stamp_us_ = 0;  // of the probe that is not answered yet; 0: none
};

}  // namespace server::link
