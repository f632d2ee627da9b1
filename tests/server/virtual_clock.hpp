// A clock for tests that moves only when nothing else can happen: the loop is idle and no worker has a job.
//
//   asio::io_context loop;
//   VirtualClock clock{loop};
//   clock.add_worker(disk);
//   spawn(...);                                        // coroutines that sleep on the clock
//   EXPECT_TRUE(clock.run_until([&] { return robot.connected(); }, 2s));
//
// Loop thread. May be destroyed before coroutines that still sleep on it; the workers outlive it.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/runtime/worker.hpp"

namespace server {

class VirtualClock final : public runtime::Clock {
 public:
  explicit VirtualClock(boost::asio::io_context& loop) : loop_{loop} {}

  std::int64_t steady_us() const override { return steady_us_; }
  std::int64_t utc_us() const override { return utc_offset_us_ + steady_us_; }
  using runtime::Clock::sleep_until;
  boost::asio::awaitable<void> sleep_until(std::int64_t deadline_us, Alarm* alarm) override;

  // Time stands still while this worker has a job.
  void add_worker(const runtime::WorkerThread& worker) { workers_.push_back(&worker); }
  void remove_worker(const runtime::WorkerThread& worker) { std::erase(workers_, &worker); }

  // Time passes and nobody is awake: who sleeps wakes after it, once, as on a machine that was halted or suspended.
  void skip(microseconds duration) {
    watch().turn(steady_us_);
    steady_us_ += duration.count();
  }

  // Moves UTC, and only UTC, as when somebody sets the machine's clock.
  void step_utc(microseconds by) { utc_offset_us_ += by.count(); }

  // Runs everything that can run now, without moving time.
  void settle();

  // Moves to the earliest deadline and wakes all who sleep until it. False when nobody sleeps.
  bool advance_to_next();

  // Runs the loop and moves time until `done`, or for `limit` of virtual time. Returns done(): false means that the
  // limit came first, or that nothing can happen any more.
  bool run_until(const std::function<bool()>& done, microseconds limit);

  void run_for(microseconds duration);

 private:
  struct Sleeper {
    boost::asio::steady_timer* timer = nullptr;
    bool* due = nullptr;
  };
  using Sleepers = std::multimap<std::int64_t, Sleeper>;  // by deadline, then in the order they fell asleep

  void advance_to(std::int64_t steady_us);

  boost::asio::io_context& loop_;
  std::vector<const runtime::WorkerThread*> workers_;
  std::shared_ptr<Sleepers> sleepers_ = std::make_shared<Sleepers>();  // shared with those who sleep
  std::int64_t steady_us_ = 1'000'000;
  std::int64_t utc_offset_us_ = 1'750'000'000'000'000;
};

}  // namespace server
