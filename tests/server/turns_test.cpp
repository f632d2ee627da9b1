// Turns: a few at once, then everybody else who is ready.
#include "server/runtime/turns.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/asio/post.hpp>
#include <functional>
#include <string>
#include <vector>

#include "server/runtime/tasks.hpp"

namespace server {
namespace {

namespace asio = boost::asio;
using ::testing::ElementsAre;

constexpr int kAtOnce = 8;

class TurnsTest : public ::testing::Test {
 protected:
  asio::awaitable<void> work(std::string name) {
    if (!turns.take()) co_await turns.wait();
    done.push_back(std::move(name));
  }
  void spawn(std::string name) { tasks.spawn(name, work(name)); }

  asio::io_context loop;
  runtime::TaskGroup tasks{loop};
  runtime::Turns turns{loop, kAtOnce};
  std::vector<std::string> done;
};

TEST_F(TurnsTest, AFewGoAtOnceAndTheOthersAfterThoseThatAreReadyThen) {
  for (int i = 0; i < 2 * kAtOnce + 1; ++i) spawn("page");
  asio::post(loop, [this] { done.emplace_back("person"); });
  loop.run();
  ASSERT_EQ(done.size(), 2 * kAtOnce + 2u);
  EXPECT_EQ(done[kAtOnce], "person") << "after the first few";
  EXPECT_EQ(turns.waiting(), 0u);
}

// Each step of a person's request waits for one round at most, however many pages something is written to.
TEST_F(TurnsTest, EachStepOfARequestWaitsForOneRoundAtMost) {
  for (int i = 0; i < 10 * kAtOnce; ++i) spawn("page");
  std::vector<std::size_t> seen;
  std::function<void()> step = [&] {
    seen.push_back(done.size());
    if (seen.size() < 4) asio::post(loop, step);
  };
  asio::post(loop, step);
  loop.run();
  ASSERT_EQ(seen.size(), 4u);
  for (std::size_t i = 1; i < seen.size(); ++i) EXPECT_LE(seen[i] - seen[i - 1], std::size_t{kAtOnce});
}

TEST_F(TurnsTest, WhoComesLaterDoesNotOvertake) {
  for (int i = 0; i < kAtOnce; ++i) spawn("");
  for (const char* name : {"a", "b", "c"}) spawn(name);
  loop.run();
  done.erase(done.begin(), done.begin() + kAtOnce);
  EXPECT_THAT(done, ElementsAre("a", "b", "c"));
}

TEST_F(TurnsTest, WhoStillWaitsAtTheEndIsLetGo) {
  for (int i = 0; i < 3 * kAtOnce; ++i) spawn("page");
  while (turns.waiting() == 0) loop.poll_one();
  EXPECT_EQ(done.size(), 1u * kAtOnce) << "who waits is destroyed with the turns, before the loop";
}

}  // namespace
}  // namespace server
