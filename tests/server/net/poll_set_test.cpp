// The set of sockets: who is called when, with real sockets in virtual time.
#include "server/net/poll_set.hpp"

#include <gmock/gmock.h>

#include <boost/asio/post.hpp>

#include "tests/server/net/poll_set_fixture.hpp"

namespace server {
namespace {

TEST_F(PollSetTest, WhatIsNotReadToTheEndIsReadyAgain) {
  add_lines(1);
  for (int i = 0; i < 5; ++i) lines[0]->say('x');
  clock.run_for(10 * net::PollSet::kPause);
  EXPECT_EQ(received.size(), 5U) << "a call takes one byte";
}

// One robot is read when it sends; of a fleet one poll reads all bytes of the pause.
TEST_F(PollSetTest, AFleetIsLookedAtOncePerPause) {
  add_lines(3);
  all_say();
  clock.settle();
  EXPECT_EQ(received.size(), 3U) << "the first look is at once";
  all_say();
  clock.settle();
  EXPECT_EQ(received.size(), 3U);
  clock.run_for(net::PollSet::kPause - 1us);
  EXPECT_EQ(received.size(), 3U);
  clock.run_for(1us);
  clock.settle();
  EXPECT_EQ(received.size(), 6U);
  clock.run_for(1s);
  lines[1]->say('x');
  clock.settle();
  EXPECT_EQ(received.size(), 7U) << "after a silence at once again";
}

TEST_F(PollSetTest, TwoWithinAPauseAreAFleetUntilItHasBeenQuiet) {
  add_lines(2);
  lines[0]->say('x');
  clock.settle();
  clock.run_for(1ms);
  lines[1]->say('x');
  clock.settle();
  EXPECT_EQ(received, (std::vector<int>{0, 1}));
  for (std::size_t looks = 1; looks <= net::PollSet::kQuietRounds; ++looks) {
    lines[0]->say('x');
    clock.settle();
    EXPECT_EQ(received.size(), 1 + looks);
    clock.run_for(net::PollSet::kPause);
    EXPECT_EQ(received.size(), 2 + looks);
  }
  lines[0]->say('x');
  clock.settle();
  EXPECT_EQ(received.size(), 3U + net::PollSet::kQuietRounds);
}

TEST_F(PollSetTest, EverybodyElseHasATurnAfterAFew) {
  add_lines(10 * net::PollSet::kAtOnce);
  all_say();
  std::vector<std::size_t> seen;
  std::function<void()> step = [&] {
    seen.push_back(received.size());
    if (received.size() < lines.size()) asio::post(loop, step);
  };
  asio::post(loop, step);
  clock.settle();
  ASSERT_GE(seen.size(), 10U);
  for (std::size_t i = 1; i < seen.size(); ++i) EXPECT_LE(seen[i] - seen[i - 1], std::size_t{net::PollSet::kAtOnce});
  std::ranges::sort(received);
  for (std::size_t i = 0; i < lines.size(); ++i) EXPECT_EQ(received.at(i), static_cast<int>(i));
}

// SAFETY: what the answer to an emergency stop rests on.
TEST_F(PollSetTest, TheAwaitedWaitsForNoPauseAndNoOther) {
  add_lines(10 * net::PollSet::kAtOnce);
  all_say();
  clock.settle();
  received.clear();
  lines.back()->socket().set_pace(net::ReadPace::awaited);
  all_say();
  clock.settle();
  EXPECT_THAT(received, ::testing::ElementsAre(static_cast<int>(lines.size()) - 1)) << "the others are in their pause";
  clock.run_for(net::PollSet::kPause);
  clock.settle();
  EXPECT_EQ(received.size(), lines.size());

  received.clear();
  clock.run_for(1s);  // a look is due, and takes them eight at a time
  all_say();
  lines.back()->socket().set_pace(net::ReadPace::prompt);
  lines[0]->socket().set_pace(net::ReadPace::awaited);
  for (int i = 0; i < 1000 && std::ranges::find(received, 0) == received.end(); ++i) {
    loop.restart();
    loop.poll_one();
  }
  EXPECT_THAT(received, ::testing::Contains(0));
  EXPECT_GT(received.size(), 1U);
  EXPECT_LE(received.size(), 2U * net::PollSet::kAtOnce) << "a round of the others at most, and one that was under way";
}

TEST_F(PollSetTest, WhoIsNoLongerAwaitedWaitsAgain) {
  add_lines(2);
  all_say();
  clock.settle();
  received.clear();
  lines[0]->socket().set_pace(net::ReadPace::awaited);
  lines[0]->socket().set_pace(net::ReadPace::prompt);
  all_say();
  clock.settle();
  EXPECT_TRUE(received.empty());
}

// What had come before, unread.
TEST_F(PollSetTest, WhatHasComeIsReadWhereverItsSocketGoes) {
  add_lines(2);
  all_say();
  clock.settle();
  received.clear();
  all_say();
  lines[0]->socket().set_pace(net::ReadPace::awaited);
  clock.settle();
  EXPECT_EQ(received, std::vector<int>{0});
  lines[0]->say('x');
  lines[0]->socket().set_pace(net::ReadPace::prompt);
  clock.settle();
  EXPECT_EQ(received, std::vector<int>{0});
  clock.run_for(net::PollSet::kPause);
  EXPECT_EQ(received.size(), 3U);
}

TEST_F(PollSetTest, AnEventThatNobodyWatchesDoesNotKeepTheLoopBusy) {
  add_lines(2);
  lines[0]->socket().set_pace(net::ReadPace::awaited);
  for (const auto& line : lines) line->socket().watch(nullptr);
  all_say();
  lines[1]->hang_up();
  clock.run_for(1s);
  const std::int64_t before_us = clock.steady_us();
  clock.run_until([] { return false; }, 1s);
  EXPECT_EQ(clock.steady_us(), before_us) << "nobody sleeps, and the loop had settled";
  lines[0]->socket().watch([this] {
    if (lines[0]->take()) received.push_back(0);
  });
  clock.settle();
  EXPECT_THAT(received, ::testing::ElementsAre(0));
}

TEST_F(PollSetTest, TheEndIsReported) {
  add_lines(1);
  bool has_ended = false;
  lines[0]->socket().watch([&] {
    if (!lines[0]->take()) has_ended = true;
  });
  lines[0]->say('x');
  lines[0]->hang_up();
  clock.run_for(3 * net::PollSet::kPause);
  EXPECT_TRUE(has_ended);
}

TEST_F(PollSetTest, WhoLeavesDuringALookIsNotCalled) {
  add_lines(net::PollSet::kAtOnce);
  for (const auto& line : lines) {
    line->socket().watch([&, line = line.get()] {
      line->take();
      received.push_back(1);
      for (const auto& other : lines) {
        if (other.get() != line) other->leave();
      }
    });
  }
  all_say();
  clock.run_for(1s);
  EXPECT_EQ(received.size(), 1U);
}

TEST_F(PollSetTest, AWriterWaitsForRoom) {
  add_lines(1);
  lines[0]->fill();
  tasks.spawn("writer", wait_for_room(*lines[0]));
  clock.run_for(1s);
  EXPECT_TRUE(waits_ended.empty());
  lines[0]->say('x');
  clock.run_for(1s);
  EXPECT_TRUE(waits_ended.empty()) << "reading does not end its wait";
  EXPECT_EQ(received.size(), 1U);
  lines[0]->drain();
  clock.run_for(1s);
  EXPECT_THAT(waits_ended, ::testing::ElementsAre("room"));
  const std::int64_t before_us = clock.steady_us();
  clock.run_until([] { return false; }, 1s);
  EXPECT_EQ(clock.steady_us(), before_us) << "room that nobody waits for does not keep the loop busy";
}

TEST_F(PollSetTest, AWriterIsWokenByTheEndAndByCancelling) {
  add_lines(2);
  for (const auto& line : lines) {
    line->fill();
    tasks.spawn("writer", wait_for_room(*line));
  }
  clock.settle();
  lines[0]->hang_up();
  clock.run_for(1s);
  EXPECT_THAT(waits_ended, ::testing::ElementsAre("room")) << "the next write tells of the end";
  tasks.stop();
  clock.settle();
  EXPECT_THAT(waits_ended, ::testing::ElementsAre("room", "cancelled"));
}

TEST_F(PollSetTest, WhoStillWaitsAtTheEndOfTheSetIsLetGo) {
  struct Held {
    std::shared_ptr<Line> line;
    static asio::awaitable<void> wait(std::shared_ptr<Line> line) { co_await line->socket().writable(); }
  };
  auto other = std::make_unique<net::PollSet>(loop, clock);
  auto line = std::make_shared<Line>(*other);
  line->fill();
  tasks.spawn("writer", Held::wait(line));
  clock.settle();
  const std::weak_ptr<Line> seen = line;
  line.reset();
  ASSERT_FALSE(seen.expired()) << "the coroutine has it";
  other.reset();
  clock.settle();
  EXPECT_TRUE(seen.expired());
}

}  // namespace
}  // namespace server
