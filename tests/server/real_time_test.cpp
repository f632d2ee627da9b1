// Priorities of the station's threads, where the system permits them.
#include "server/runtime/real_time.hpp"

#include <gtest/gtest.h>
#include <sched.h>

#include <thread>

#include "server/runtime/tasks.hpp"

namespace server {
namespace {

namespace asio = boost::asio;

struct Scheduling {
  int policy = -1, priority = -1;
};
Scheduling present() {
  sched_param parameters{};
  sched_getparam(0, &parameters);
  return {sched_getscheduler(0) & ~SCHED_RESET_ON_FORK, parameters.sched_priority};
}

TEST(RealTime, TheLoopIsBeforeTheDiskAndBothBeforeOrdinaryThreads) {
  Scheduling loop_thread, disk_thread;
  std::jthread{[&] {
    asio::io_context loop;
    runtime::WorkerThread disk{"disk"};
    runtime::run_first(loop, ask_for_real_time(disk));
    loop_thread = present();
    auto look = [](runtime::WorkerThread& worker) -> asio::awaitable<Scheduling> {
      auto job = [] { return present(); };
      co_return co_await worker.run(std::move(job));
    };
    disk_thread = runtime::run_first(loop, look(disk));
  }}.join();
  if (loop_thread.policy == SCHED_OTHER) GTEST_SKIP() << "the system does not permit real-time priority";
  EXPECT_EQ(loop_thread.policy, SCHED_RR);
  EXPECT_EQ(disk_thread.policy, SCHED_RR);
  EXPECT_GT(loop_thread.priority, disk_thread.priority);
  EXPECT_EQ(present().policy, SCHED_OTHER) << "of this thread alone";
}

}  // namespace
}  // namespace server
