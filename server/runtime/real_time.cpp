// SCHED_RR.
#include "server/runtime/real_time.hpp"

#include <sched.h>
#include <spdlog/spdlog.h>

namespace server::runtime {

bool ask_for_real_time(Priority priority) {
  sched_param parameters{};
  parameters.sched_priority = sched_get_priority_min(SCHED_RR) + static_cast<int>(priority);
  return sched_setscheduler(0, SCHED_RR | SCHED_RESET_ON_FORK, &parameters) == 0;
}

boost::asio::awaitable<void> ask_for_real_time(WorkerThread& disk) {
  const bool is_granted = ask_for_real_time(Priority::loop);
  spdlog::info("the loop runs {}",
               is_granted ? "with real-time priority" : "without real-time priority: the system does not permit it");
  auto ask = [] { return ask_for_real_time(Priority::disk); };
  co_await disk.run(std::move(ask));
}

}  // namespace server::runtime
