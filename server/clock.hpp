// Where all of the station's time comes from: steady time, UTC and the only timer, from one injected object.
//
// Nothing else in server/ reads a clock or sets a timer, so a test can run the whole station in virtual time. A Clock
// lives on the loop's thread and outlives every coroutine that waits on it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>

namespace server {

using std::chrono::microseconds;

class Clock {
 public:
  virtual ~Clock() = default;
  Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;

  virtual std::int64_t steady_us() const = 0;  // since an arbitrary start, never goes back
  virtual std::int64_t utc_us() const = 0;     // since 1970, may step

  // Returns when steady_us() has reached the deadline. Throws operation_aborted when cancelled.
  virtual boost::asio::awaitable<void> sleep_until(std::int64_t deadline_us) = 0;

  boost::asio::awaitable<void> sleep_for(microseconds duration) { return sleep_until(steady_us() + duration.count()); }
};

// The clocks of the machine.
class SystemClock final : public Clock {
 public:
  explicit SystemClock(boost::asio::io_context& loop) : loop_{loop} {}

  std::int64_t steady_us() const override;
  std::int64_t utc_us() const override;
  boost::asio::awaitable<void> sleep_until(std::int64_t deadline_us) override;

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

 private:
  boost::asio::steady_timer timer_;
  std::uint64_t notifications_ = 0;
  bool remembered_ = false;  // a notification that nobody has taken yet
};

}  // namespace server
