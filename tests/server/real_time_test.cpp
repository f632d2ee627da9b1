// Priorities of the station's threads, where the system permits them.
#include "server/runtime/real_time.hpp"

#include <gtest/gtest.h>
#include <sched.h>

#include <algorithm>
#include <functional>
#include <thread>
#include <vector>

#include "server/runtime/tasks.hpp"

namespace server {
namespace {

namespace asio = boost::asio;
using namespace std::chrono_literals;

struct Scheduling {
  int policy = -1, priority = -1;
};
Scheduling present() {
  sched_param parameters{};
  sched_getparam(0, &parameters);
  return {sched_getscheduler(0) & ~SCHED_RESET_ON_FORK, parameters.sched_priority};
}

// The thread of a loop, and a disk's, whose priorities are kept until `until` has ended.
void run_station(const std::function<asio::awaitable<void>(runtime::WorkerThread&, runtime::Clock&)>& until) {
  std::jthread{[&] {
    asio::io_context loop;
    runtime::SystemClock clock{loop};
    runtime::WorkerThread disk{"disk"};
    runtime::TaskGroup tasks{loop};
    auto end = [&]() -> asio::awaitable<void> {
      co_await until(disk, clock);
      tasks.stop();
    };
    tasks.spawn("priorities", keep_priorities(disk, clock));
    tasks.spawn("end", end());
    tasks.run(clock);
  }}.join();
}

asio::awaitable<Scheduling> present_of(runtime::WorkerThread& worker) {
  auto job = [] { return present(); };
  co_return co_await worker.run(std::move(job));
}

bool is_permitted() {
  bool is_granted = false;
  std::jthread{[&] { is_granted = runtime::set_priority(runtime::Priority::loop); }}.join();
  return is_granted;
}

// More of them than processors: what is not ahead of them has to wait.
class Rivals {
 public:
  Rivals() {
    const unsigned count = 4 * std::max(1U, std::thread::hardware_concurrency());
    for (unsigned each = 0; each < count; ++each) {
      threads_.emplace_back([](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
        }
      });
    }
  }

 private:
  std::vector<std::jthread> threads_;
};

TEST(RealTime, OnABusyMachineTheLoopIsBeforeTheDiskAndBothBeforeOrdinaryThreads) {
  if (!is_permitted()) GTEST_SKIP() << "the system does not permit real-time priority";
  Scheduling loop_thread, disk_thread;
  const Rivals rivals;
  run_station([&](runtime::WorkerThread& disk, runtime::Clock& clock) -> asio::awaitable<void> {
    for (;;) {  // ordinary at first, whatever the machine does otherwise
      loop_thread = present();
      disk_thread = co_await present_of(disk);
      if (loop_thread.policy == SCHED_RR && disk_thread.policy == SCHED_RR) break;
      const std::int64_t busy_until_us = clock.steady_us() + 1000;  // so that it wants a processor
      while (clock.steady_us() < busy_until_us) {
      }
      co_await clock.sleep_for(1ms);
    }
  });
  EXPECT_GT(loop_thread.priority, disk_thread.priority);
  EXPECT_EQ(present().policy, SCHED_OTHER) << "of this thread alone";
}

TEST(RealTime, AThreadThatIsOrdinaryAgainMayAskAgain) {
  if (!is_permitted()) GTEST_SKIP() << "the system does not permit real-time priority";
  std::jthread{[] {
    ASSERT_TRUE(runtime::set_priority(runtime::Priority::disk));
    EXPECT_EQ(present().policy, SCHED_RR);
    ASSERT_TRUE(runtime::set_priority(runtime::Priority::ordinary));
    EXPECT_EQ(present().policy, SCHED_OTHER);
    EXPECT_NE(sched_getscheduler(0) & SCHED_RESET_ON_FORK, 0) << "what doctor sees of a station that may have it";
    EXPECT_TRUE(runtime::set_priority(runtime::Priority::loop));
  }}.join();
}

using runtime::PriorityChoice;
constexpr std::int64_t kPeriodUs = PriorityChoice::kPeriod.count(), kHoldUs = PriorityChoice::kHold.count();
constexpr std::int64_t kMuchUs = static_cast<std::int64_t>(PriorityChoice::kMostWaited * kPeriodUs) + 1;
constexpr std::int64_t kAlwaysUs = static_cast<std::int64_t>(PriorityChoice::kMostRun * kPeriodUs) + 1;

struct Looks {
  PriorityChoice choice;
  std::int64_t now_us = 5'000'000;
  runtime::ThreadTime loop{.ran_us = 99'000, .waited_us = 77'000};
  Looks() { choice.look(now_us, loop); }
  bool after(std::int64_t passed_us, std::int64_t waited_us, std::int64_t ran_us = 0) {
    loop.ran_us += ran_us;
    loop.waited_us += waited_us;
    return choice.look(now_us += passed_us, loop);
  }
};

TEST(PriorityChoice, ALoopThatHardlyWaitsStaysOrdinary) {
  Looks looks;
  for (int look = 0; look < 1000; ++look) EXPECT_FALSE(looks.after(kPeriodUs, kMuchUs - 1));
}

TEST(PriorityChoice, OneThatHadToWaitIsRealTimeForAWhileAndThenTriesWithout) {
  Looks looks;
  ASSERT_TRUE(looks.after(kPeriodUs, kMuchUs));
  for (std::int64_t passed_us = kPeriodUs; passed_us < kHoldUs; passed_us += kPeriodUs)
    ASSERT_TRUE(looks.after(kPeriodUs, 0)) << passed_us;
  EXPECT_FALSE(looks.after(kPeriodUs, 0));
  EXPECT_TRUE(looks.after(kPeriodUs, kMuchUs)) << "the machine is still busy";
}

TEST(PriorityChoice, WhatWasWaitedInALongerTimeIsJudgedByThatTime) {
  Looks looks;
  EXPECT_FALSE(looks.after(4 * kPeriodUs, 3 * kMuchUs)) << "the loop stood still or was suspended";
  EXPECT_TRUE(looks.after(kPeriodUs / 4, kMuchUs));
}

TEST(PriorityChoice, ALoopThatNeverRestsIsOrdinarySoThatTheKernelsOwnThreadsGetItsProcessor) {
  Looks looks;
  EXPECT_FALSE(looks.after(kPeriodUs, kMuchUs, kAlwaysUs));
  ASSERT_TRUE(looks.after(kPeriodUs, kMuchUs, kAlwaysUs - 1));
  EXPECT_FALSE(looks.after(kPeriodUs, 0, kAlwaysUs));
}

}  // namespace
}  // namespace server
