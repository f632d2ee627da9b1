// SCHED_RR, and what Linux says of a thread's time.
#include "server/runtime/real_time.hpp"

#include <sched.h>
#include <spdlog/spdlog.h>

#include <fstream>
#include <optional>

namespace server::runtime {
namespace {

// Of the calling thread; nothing where Linux does not say.
std::optional<ThreadTime> thread_time() {
  std::ifstream file{"/proc/thread-self/schedstat"};
  std::int64_t ran_ns = 0, waited_ns = 0;
  if (!(file >> ran_ns >> waited_ns)) return std::nullopt;
  return ThreadTime{.ran_us = ran_ns / 1000, .waited_us = waited_ns / 1000};
}

boost::asio::awaitable<bool> set_priorities(bool are_real_time, WorkerThread& disk) {
  const bool is_granted = set_priority(are_real_time ? Priority::loop : Priority::ordinary);
  auto follow = [are_real_time] { return set_priority(are_real_time ? Priority::disk : Priority::ordinary); };
  co_await disk.run(std::move(follow));
  co_return is_granted;
}

}  // namespace

bool set_priority(Priority priority) {
  sched_param parameters{};
  const bool is_ordinary = priority == Priority::ordinary;
  if (!is_ordinary) parameters.sched_priority = sched_get_priority_min(SCHED_RR) + static_cast<int>(priority);
  return sched_setscheduler(0, (is_ordinary ? SCHED_OTHER : SCHED_RR) | SCHED_RESET_ON_FORK, &parameters) == 0;
}

bool PriorityChoice::look(std::int64_t now_us, const ThreadTime& loop) {
  const auto passed_us = static_cast<double>(now_us - last_us_);
  const auto ran_us = static_cast<double>(loop.ran_us - last_.ran_us);
  const auto waited_us = static_cast<double>(loop.waited_us - last_.waited_us);
  last_us_ = now_us;
  last_ = loop;
  if (ran_us > kMostRun * passed_us) {
    is_real_time_ = false;
  } else if (is_real_time_) {
    is_real_time_ = now_us < until_us_;
  } else if (waited_us > kMostWaited * passed_us) {
    is_real_time_ = true;
    until_us_ = now_us + kHold.count();
  }
  return is_real_time_;
}

boost::asio::awaitable<void> keep_priorities(WorkerThread& disk, Clock& clock) {
  const bool is_permitted = co_await set_priorities(true, disk);
  spdlog::info("the loop {}", is_permitted ? "may have real-time priority, and has it while the machine is busy"
                                           : "runs without real-time priority: the system does not permit it");
  std::optional<ThreadTime> time = thread_time();
  if (!is_permitted || !time) co_return;  // without a measure the priority is kept
  PriorityChoice choice;
  choice.look(clock.steady_us(), *time);
  bool is_real_time = true;
  for (; time; time = thread_time()) {
    const bool is_needed = choice.look(clock.steady_us(), *time);
    if (is_needed != is_real_time) co_await set_priorities(is_needed, disk);
    is_real_time = is_needed;
    co_await clock.sleep_for(PriorityChoice::kPeriod);
  }
}

}  // namespace server::runtime
