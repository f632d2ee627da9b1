// Priorities of the station's threads: ordinary as long as the loop gets a processor when it wants one; on a busy
// machine the loop comes first, then the thread that writes what the loop receives, then all others.
//
//   the loop waited for a processor, more than 5 % of the last quarter second  → real time, for 30 s
//   then ordinary for a quarter second                                         → which shows whether it is still needed
//   the loop ran more than 85 % of a quarter second                            → ordinary, at once
//
// Real-time priority makes a stop faster on a busy machine and slower on an idle one; and a loop that never rests would
// keep the kernel's own threads from its processor, which finish what the disk has done (decision 0075). main.cpp asks
// for it, in one line; ARCHITECTURE.md says what the station is without it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>

#include "server/runtime/clock.hpp"
#include "server/runtime/worker.hpp"

namespace server::runtime {

enum class Priority : int { ordinary = -1, disk = 0, loop = 1 };  // above the least of SCHED_RR

// For the calling thread. False where the system does not permit it. What the thread starts, a tool of a shell say, is
// always ordinary.
bool set_priority(Priority priority);

// What Linux counts of a thread since it began, in µs.
struct ThreadTime {
  std::int64_t ran_us = 0;
  std::int64_t waited_us = 0;  // for a processor, while it could run
};

// Decides when the loop needs real-time priority. Pure. Times are steady µs.
class PriorityChoice {
 public:
  static constexpr microseconds kPeriod{250'000};  // between two looks
  static constexpr double kMostWaited = 0.05;      // of the time
  static constexpr double kMostRun = 0.85;
  static constexpr microseconds kHold{30'000'000};

  // Whether it needs it from now on.
  bool look(std::int64_t now_us, const ThreadTime& loop);

 private:
  bool is_real_time_ = false;
  std::int64_t until_us_ = 0;  // while it is real time
  std::int64_t last_us_ = 0;
  ThreadTime last_;
};

// Gives the loop that this runs on, and the worker's thread, which a loop with real-time priority would leave no time
// otherwise, the priority that PriorityChoice says, for as long as the loop runs. Logs whether that is permitted;
// where it is not, they go on without.
boost::asio::awaitable<void> keep_priorities(WorkerThread& disk, Clock& clock);

}  // namespace server::runtime
