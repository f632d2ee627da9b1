// Virtual time moves only when nothing else can happen.
#include "tests/server/virtual_clock.hpp"

#include <gtest/gtest.h>

#include <boost/asio/experimental/awaitable_operators.hpp>
#include <thread>

#include "server/tasks.hpp"

namespace server {
namespace {

namespace asio = boost::asio;
using namespace asio::experimental::awaitable_operators;
using namespace std::chrono_literals;

class VirtualClockTest : public ::testing::Test {
 protected:
  asio::io_context loop_{1};
  WorkerThread worker_{"worker"};
  VirtualClock clock_{loop_};
  TaskGroup tasks_{loop_};
  std::vector<std::int64_t> woken_us_;

  void SetUp() override { clock_.add_worker(worker_); }

  asio::awaitable<void> sleep_and_note(microseconds duration) {
    co_await clock_.sleep_for(duration);
    woken_us_.push_back(clock_.steady_us());
  }
};

TEST_F(VirtualClockTest, WakesSleepersInOrderAtTheirDeadlines) {
  const std::int64_t start_us = clock_.steady_us();
  tasks_.spawn("late", sleep_and_note(2h));
  tasks_.spawn("early", sleep_and_note(1ms));
  EXPECT_TRUE(clock_.run_until([&] { return woken_us_.size() == 2; }, 3h));
  EXPECT_EQ(woken_us_, (std::vector<std::int64_t>{start_us + 1000, start_us + 7'200'000'000}));
}

TEST_F(VirtualClockTest, StopsAtTheLimit) {
  const std::int64_t start_us = clock_.steady_us();
  tasks_.spawn("sleeper", sleep_and_note(2s));
  EXPECT_FALSE(clock_.run_until([&] { return !woken_us_.empty(); }, 1s));
  EXPECT_EQ(clock_.steady_us(), start_us + 1'000'000);
  EXPECT_TRUE(clock_.run_until([&] { return !woken_us_.empty(); }, 1s));
}

TEST_F(VirtualClockTest, StandsStillWhileAWorkerHasAJob) {
  const std::int64_t start_us = clock_.steady_us();
  std::int64_t finished_us = 0;
  auto task = [](WorkerThread& worker, Clock& clock, std::int64_t& finished) -> asio::awaitable<void> {
    auto job = [] { std::this_thread::yield(); };
    co_await worker.run(std::move(job));
    finished = clock.steady_us();
  };
  tasks_.spawn("job", task(worker_, clock_, finished_us));
  tasks_.spawn("sleeper", sleep_and_note(1us));
  EXPECT_TRUE(clock_.run_until([&] { return finished_us != 0; }, 1s));
  EXPECT_EQ(finished_us, start_us);
}

TEST_F(VirtualClockTest, TheLoserOfARaceIsCancelledAndForgotten) {
  bool first_won = false;
  auto task = [](Clock& clock, bool& won) -> asio::awaitable<void> {
    const auto winner = co_await (clock.sleep_for(1s) || clock.sleep_for(1h));
    won = winner.index() == 0;
  };
  const std::int64_t start_us = clock_.steady_us();
  tasks_.spawn("race", task(clock_, first_won));
  EXPECT_TRUE(clock_.run_until([&] { return first_won; }, 2h));
  EXPECT_EQ(clock_.steady_us(), start_us + 1'000'000);
  EXPECT_FALSE(clock_.advance_to_next());
}

TEST_F(VirtualClockTest, StoppingTheTasksEndsTheirSleepAndTheirRaces) {
  tasks_.spawn("sleeper", sleep_and_note(1h));
  auto race = [](Clock& clock) -> asio::awaitable<void> { co_await (clock.sleep_for(1h) || clock.sleep_for(2h)); };
  tasks_.spawn("race", race(clock_));
  clock_.settle();
  tasks_.stop();
  clock_.settle();
  EXPECT_TRUE(woken_us_.empty());
  EXPECT_EQ(tasks_.exit_code(), 0);
  EXPECT_FALSE(clock_.advance_to_next());
}

}  // namespace
}  // namespace server
