// How late the loop wakes what sleeps on it: a timer asks four times a second, and what it is late by is counted.
//
// A loop that is busy, or a machine that gives it no time, shows here before a stop is late. Loop thread.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <chrono>

#include "server/runtime/clock.hpp"
#include "server/runtime/histogram.hpp"

namespace server::runtime {

class LoopLateness {
 public:
  static constexpr microseconds kInterval{std::chrono::milliseconds{250}};

  // Until cancelled.
  boost::asio::awaitable<void> run(Clock& clock) {
    for (;;) {
      const std::int64_t due_us = clock.steady_us() + kInterval.count();
      co_await clock.sleep_until(due_us);
      times_.add(clock.steady_us() - due_us);
    }
  }

  const TimeHistogram& times() const { return times_; }

 private:
  TimeHistogram times_;
};

}  // namespace server::runtime
