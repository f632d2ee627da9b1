// Priorities of the station's threads on a busy machine: the loop first, then the thread that writes what the loop
// receives, then all others. main.cpp asks for them, in one line; ARCHITECTURE.md says what the station is without
// them.
#pragma once

#include <boost/asio/awaitable.hpp>

#include "server/runtime/worker.hpp"

namespace server::runtime {

enum class Priority : int { disk = 0, loop = 1 };  // above the least of SCHED_RR

// For the calling thread. False where the system does not permit it. What the thread starts, a tool of a shell say, is
// ordinary again.
bool ask_for_real_time(Priority priority);

// For the thread of the loop that this runs on, and for the worker's, which a loop with real-time priority would leave
// no time otherwise. Logs whether it was granted; where it is not, they go on without.
boost::asio::awaitable<void> ask_for_real_time(WorkerThread& disk);

}  // namespace server::runtime
