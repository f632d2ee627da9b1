// Virtual time moves only when nothing else can happen.
#include "tests/server/virtual_clock.hpp"

#include <gtest/gtest.h>

#include <boost/asio/experimental/awaitable_operators.hpp>
#include <thread>

#include "server/runtime/tasks.hpp"

namespace server {
namespace {

namespace asio = boost::asio;
using namespace asio::experimental::awaitable_operators;
using namespace std::chrono_literals;

class VirtualClockTest : public ::testing::Test {
 protected:
  asio::io_context loop_{1};
  runtime::WorkerThread worker_{"worker"};
  VirtualClock clock_{loop_};
  runtime::TaskGroup tasks_{loop_};
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
  auto task = [](runtime::WorkerThread& worker, runtime::Clock& clock,
                 std::int64_t& finished) -> asio::awaitable<void> {
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
  auto task = [](runtime::Clock& clock, bool& won) -> asio::awaitable<void> {
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
  auto race = [](runtime::Clock& clock) -> asio::awaitable<void> {
    co_await (clock.sleep_for(1h) || clock.sleep_for(2h));
  };
  tasks_.spawn("race", race(clock_));
  clock_.settle();
  tasks_.stop();
  clock_.settle();
  EXPECT_TRUE(woken_us_.empty());
  EXPECT_EQ(tasks_.exit_code(), 0);
  EXPECT_FALSE(clock_.advance_to_next());
}

class SignalTest : public VirtualClockTest {
 protected:
  asio::awaitable<void> wait_and_note(microseconds duration) {
    const bool notified = co_await signal_.wait_until(clock_, clock_.steady_us() + duration.count());
    outcomes_.push_back(notified);
  }

  runtime::Signal signal_{loop_};
  std::vector<bool> outcomes_;
};

TEST_F(SignalTest, EndsAWaitAtOnceOrAtTheDeadline) {
  const std::int64_t start_us = clock_.steady_us();
  tasks_.spawn("waiter", wait_and_note(1h));
  tasks_.spawn("impatient", wait_and_note(1s));
  EXPECT_TRUE(clock_.run_until([&] { return outcomes_.size() == 1; }, 2s));
  EXPECT_EQ(clock_.steady_us(), start_us + 1'000'000);
  signal_.notify();
  clock_.settle();
  EXPECT_EQ(outcomes_, (std::vector{false, true}));
  EXPECT_FALSE(clock_.advance_to_next()) << "nobody sleeps any more";
}

TEST_F(SignalTest, ANotificationBeforeTheWaitIsRemembered) {
  signal_.notify();
  tasks_.spawn("waiter", wait_and_note(1h));
  tasks_.spawn("second", wait_and_note(1s));
  clock_.settle();
  EXPECT_EQ(outcomes_, std::vector{true}) << "once";
  EXPECT_TRUE(clock_.run_until([&] { return outcomes_.size() == 2; }, 2s));
  EXPECT_EQ(outcomes_, (std::vector{true, false}));
}

TEST_F(SignalTest, WakesAllWhoWait) {
  for (int i = 0; i < 3; ++i) tasks_.spawn("waiter", wait_and_note(1h));
  clock_.settle();
  signal_.notify();
  clock_.settle();
  EXPECT_EQ(outcomes_, std::vector<bool>(3, true));
}

TEST_F(SignalTest, ACancelledWaitEndsTheTask) {
  tasks_.spawn("waiter", wait_and_note(1h));
  clock_.settle();
  tasks_.stop();
  clock_.settle();
  EXPECT_TRUE(outcomes_.empty());
  EXPECT_EQ(tasks_.exit_code(), 0);
  EXPECT_FALSE(clock_.advance_to_next());
}

// The machine's clock, in real time: only order and outcome are looked at.
TEST_F(SignalTest, WorksOnTheClockOfTheMachine) {
  runtime::SystemClock machine{loop_};
  std::vector<bool> outcomes;
  auto wait = [](runtime::Signal& signal, runtime::Clock& clock, microseconds duration,
                 std::vector<bool>& into) -> asio::awaitable<void> {
    const bool notified = co_await signal.wait_until(clock, clock.steady_us() + duration.count());
    into.push_back(notified);
  };
  tasks_.spawn("short", wait(signal_, machine, 1ms, outcomes));
  loop_.run();
  EXPECT_EQ(outcomes, std::vector{false});
  loop_.restart();
  tasks_.spawn("long", wait(signal_, machine, 1h, outcomes));
  loop_.poll();
  signal_.notify();
  loop_.restart();
  loop_.run();
  EXPECT_EQ(outcomes, (std::vector{false, true}));
}

}  // namespace
}  // namespace server
