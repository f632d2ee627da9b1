// Priorities of the station's threads on a busy machine: the loop first, then the thread that writes what the loop
// receives, then all others.
#pragma once

#include <boost/asio/awaitable.hpp>

#include "server/runtime/worker.hpp"

namespace server {

enum class Priority : int { disk = 0, loop = 1 };  // above the least of SCHED_RR

// For the calling thread. False where the system does not permit it. What the thread starts, a tool of a shell say, is
// ordinary again.
bool ask_for_real_time(Priority priority);

// For the worker's thread: a loop with real-time priority would leave it no time otherwise.
boost::asio::awaitable<void> ask_for_real_time(WorkerThread& disk);

}  // namespace server
