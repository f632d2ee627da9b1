// Coroutines that wait for what is durable: which commit ends their wait, who gives up, and what wakes the run loop.
#include "server/storage/ingest/flush_waiters.hpp"

#include <gtest/gtest.h>

#include <map>
#include <string>

#include "server/runtime/tasks.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

using namespace std::chrono_literals;
namespace asio = boost::asio;

class FlushWaitersTest : public ::testing::Test {
 protected:
  ~FlushWaitersTest() override {
    tasks_.stop();
    clock_.settle();
  }

  void wait_for(const std::string& name, std::uint64_t position) {
    tasks_.spawn(name, note(name, position));
    clock_.settle();
  }
  void commit(std::uint64_t position) {
    waiters_.on_commit_built();
    waiters_.on_durable(position);
    clock_.settle();
  }
  void wait_until_wanted(std::int64_t steady_us) {
    tasks_.spawn("run loop", note_wanted(steady_us));
    clock_.settle();
  }

  asio::io_context loop_{1};
  VirtualClock clock_{loop_};
  runtime::TaskGroup tasks_{loop_};
  storage::FlushWaiters waiters_{loop_, clock_};
  std::map<std::string, bool> outcomes_;   // by name: it became durable
  std::optional<std::int64_t> wanted_us_;  // steady, when the run loop went on

 private:
  asio::awaitable<void> note(std::string name, std::uint64_t position) {
    const bool is_durable = co_await waiters_.wait_for(position);
    outcomes_[name] = is_durable;
  }
  asio::awaitable<void> note_wanted(std::int64_t steady_us) {
    co_await waiters_.until_wanted(steady_us);
    wanted_us_ = clock_.steady_us();
  }
};

using Outcomes = std::map<std::string, bool>;

TEST_F(FlushWaitersTest, RecordsAreDurableWithTheCommitThatIsBuiltAfterTheWaitBegan) {
  waiters_.on_commit_built();
  wait_for("late", 0);  // its records are in no commit yet
  waiters_.on_durable(7);
  clock_.settle();
  EXPECT_EQ(outcomes_, Outcomes{});
  commit(7);
  EXPECT_EQ(outcomes_, (Outcomes{{"late", true}}));
  EXPECT_TRUE(waiters_.empty());
}

TEST_F(FlushWaitersTest, SegmentsAreDurableOnceAsManyHaveLeftTheQueue) {
  wait_for("first", 2);
  wait_for("second", 3);
  commit(1);
  EXPECT_EQ(outcomes_, Outcomes{});
  commit(2);
  EXPECT_EQ(outcomes_, (Outcomes{{"first", true}}));
  EXPECT_EQ(waiters_.size(), 1U);
  commit(5);
  EXPECT_EQ(outcomes_, (Outcomes{{"first", true}, {"second", true}}));
}

TEST_F(FlushWaitersTest, WhoeverWaitsThreeSecondsGivesUp) {
  wait_for("patient", 1);
  clock_.run_for(2'999ms);
  EXPECT_EQ(outcomes_, Outcomes{});
  clock_.run_for(1ms);
  EXPECT_EQ(outcomes_, (Outcomes{{"patient", false}}));
}

TEST_F(FlushWaitersTest, WhoeverGaveUpOrWasCancelledIsDroppedWhenTheNextOneComes) {
  for (int i = 0; i < 5; ++i) {
    wait_for("patient", 1);
    clock_.run_for(3s);
    EXPECT_EQ(waiters_.size(), 1U) << "while the disk fails nothing else drops them";
  }
  commit(1);
  EXPECT_TRUE(waiters_.empty());
  EXPECT_EQ(outcomes_, (Outcomes{{"patient", false}}));
}

TEST_F(FlushWaitersTest, TheRunLoopWaitsUntilItsTimeWhenNobodyElseDoes) {
  const std::int64_t due_us = clock_.steady_us() + 100'000;
  wait_until_wanted(due_us);
  clock_.run_for(99ms);
  EXPECT_FALSE(wanted_us_);
  clock_.run_for(1ms);
  EXPECT_EQ(wanted_us_, due_us);
}

TEST_F(FlushWaitersTest, TheRunLoopGoesOnAtOnceForWhoeverWaits) {
  const std::int64_t began_us = clock_.steady_us();
  wait_until_wanted(began_us + 100'000);
  clock_.run_for(30ms);
  wait_for("reader", 1);
  EXPECT_EQ(wanted_us_, began_us + 30'000);
  wanted_us_.reset();
  wait_until_wanted(began_us + 100'000);
  EXPECT_EQ(wanted_us_, began_us + 30'000) << "it waits still";
}

}  // namespace
}  // namespace server
