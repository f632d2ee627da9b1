// The station's clock: steady time, UTC and the only timer, in one injected object.
//
// Nothing else in server/ reads a clock or sets a timer, so a test can run the whole station in virtual time. A Clock
// lives on the loop's thread and outlives every coroutine that waits on it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>
#include <memory>
#include <vector>

#include "server/runtime/loop_watch.hpp"

namespace server {
using std::chrono::microseconds;  // every time and duration of the program
class VirtualClock;               // of the tests
}  // namespace server

namespace server::runtime {

class Clock {
 public:
  virtual ~Clock() = default;
  Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;

  // Since an arbitrary start, never goes back. SAFETY: goes on while the machine is suspended, so that nothing outlives
  // its time in a sleeping laptop: no command, lease, stamp or link.
  virtual std::int64_t steady_us() const = 0;
  virtual std::int64_t utc_us() const = 0;  // since 1970, may step

  // What ends a sleep early; of one sleeper.
  class Alarm {
   public:
    void ring() {
      has_rung_ = true;
      if (timer_ != nullptr) timer_->cancel();
    }

   private:
    friend class SystemClock;
    friend class server::VirtualClock;
    bool has_rung_ = false;
    boost::asio::steady_timer* timer_ = nullptr;  // while somebody sleeps
  };

  // Returns when steady_us() has reached the deadline, or when the alarm has rung. Throws operation_aborted when
  // cancelled.
  boost::asio::awaitable<void> sleep_until(std::int64_t deadline_us) { return sleep_until(deadline_us, nullptr); }
  virtual boost::asio::awaitable<void> sleep_until(std::int64_t deadline_us, Alarm* alarm) = 0;

  boost::asio::awaitable<void> sleep_for(microseconds duration) { return sleep_until(steady_us() + duration.count()); }

  // Whether the loop that runs by this clock has stood still.
  LoopWatch& watch() { return watch_; }

 private:
  LoopWatch watch_;
};

// The clocks of the machine. Who sleeps through a suspend wakes late, by at most what was left to sleep when it began.
class SystemClock final : public Clock {
 public:
  explicit SystemClock(boost::asio::io_context& loop) : loop_{loop} {}

  std::int64_t steady_us() const override;
  std::int64_t utc_us() const override;
  using Clock::sleep_until;
  boost::asio::awaitable<void> sleep_until(std::int64_t deadline_us, Alarm* alarm) override;

 private:
  boost::asio::io_context& loop_;
};

// Wakes the coroutines that wait; when none does, the next wait() returns at once. Not a timer, so virtual time needs
// no other kind. Loop thread only; must outlive the waiting coroutine.
class Signal {
 public:
  explicit Signal(boost::asio::io_context& loop) : timer_{loop, boost::asio::steady_timer::time_point::max()} {}

  void notify();
  boost::asio::awaitable<void> wait();  // throws operation_aborted when cancelled
  // The same until the clock's deadline at most; true when it was notified. It wakes in one step of the loop, where
  // `wait() || sleep` takes several.
  boost::asio::awaitable<bool> wait_until(Clock& clock, std::int64_t deadline_us);

 private:
  boost::asio::steady_timer timer_;
  std::shared_ptr<std::vector<Clock::Alarm*>> alarms_;  // of those who wait until a deadline, and shared with them
  std::uint64_t notifications_ = 0;
  bool remembered_ = false;  // a notification that nobody has taken yet
};

}  // namespace server::runtime
