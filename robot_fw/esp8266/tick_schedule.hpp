// When ticks are due: at multiples of the period; those that were missed are counted, not caught up.
#pragma once

#include <cstdint>

namespace robot_fw::esp8266 {

class TickSchedule {
 public:
  explicit TickSchedule(std::uint32_t period_us) : period_us_(period_us) {}

  // The first tick is due at once.
  void begin(std::uint64_t now_us) { next_us_ = now_us; }
  bool due(std::uint64_t now_us) const { return now_us >= next_us_; }
  // Takes the latest tick that is due and returns its time; the ones before it are missed. One must be due.
  std::uint64_t take(std::uint64_t now_us) {
    const std::uint64_t missed = (now_us - next_us_) / period_us_;
    missed_ += static_cast<std::uint32_t>(missed);
    const std::uint64_t tick_us = next_us_ + missed * period_us_;
    next_us_ = tick_us + period_us_;
    return tick_us;
  }
  std::uint32_t missed() const { return missed_; }  // since boot

 private:
  std::uint32_t period_us_;
  std::uint64_t next_us_ = 0;
  std::uint32_t missed_ = 0;
};

}  // namespace robot_fw::esp8266
