// The set of sockets: who is called when, with real sockets in virtual time.
#include "server/net/poll_set.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <boost/asio/post.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "server/runtime/tasks.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

namespace asio = boost::asio;
using namespace std::chrono_literals;

// A connection within this process: the near end is in the set.
class Line {
 public:
  explicit Line(net::PollSet& set)
      : ends_{make_pair()}, socket_{std::make_unique<net::PollSet::Socket>(set, ends_.near)} {}
  ~Line() {
    socket_.reset();
    hang_up();
    ::close(ends_.near);
  }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;

  void say(char byte) const { ASSERT_EQ(::send(ends_.far, &byte, 1, MSG_NOSIGNAL), 1); }
  void hang_up() {
    if (ends_.far >= 0) ::close(ends_.far);
    ends_.far = -1;
  }
  void fill() const {
    const std::vector<char> bytes(4096);
    while (::send(ends_.near, bytes.data(), bytes.size(), MSG_DONTWAIT) > 0) continue;
  }
  void drain() const {
    std::vector<char> bytes(4096);
    while (::recv(ends_.far, bytes.data(), bytes.size(), MSG_DONTWAIT) > 0) continue;
  }
  // What one call reads: a byte; nothing at the end.
  std::optional<char> take() const {
    char byte = 0;
    return ::recv(ends_.near, &byte, 1, MSG_DONTWAIT) == 1 ? std::optional{byte} : std::nullopt;
  }

  net::PollSet::Socket& socket() { return *socket_; }
  void leave() { socket_.reset(); }

 private:
  struct Ends {
    int near = -1, far = -1;
  };
  static Ends make_pair() {
    std::array<int, 2> ends{};
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()), 0);
    return {ends[0], ends[1]};
  }

  Ends ends_;
  std::unique_ptr<net::PollSet::Socket> socket_;
};

class PollSetTest : public ::testing::Test {
 protected:
  PollSetTest() {
    tasks.spawn("all", set->run());
    tasks.spawn("awaited", set->run_awaited());
    clock.settle();
  }
  ~PollSetTest() override {
    tasks.stop();
    clock.settle();
  }

  // Lines that note what they read under their number.
  void add_lines(int count) {
    for (int i = 0; i < count; ++i) {
      lines.push_back(std::make_unique<Line>(*set));
      Line* line = lines.back().get();
      const int number = static_cast<int>(lines.size()) - 1;
      line->socket().watch([this, line, number] {
        if (line->take()) received.push_back(number);
      });
    }
  }
  void all_say() {
    for (const auto& line : lines) line->say('x');
  }

  asio::awaitable<void> wait_for_room(Line& line) {
    try {
      co_await line.socket().writable();
      waits_ended.push_back("room");
    } catch (const boost::system::system_error& error) {
      waits_ended.push_back(error.code() == asio::error::operation_aborted ? "cancelled" : error.what());
      throw;
    }
  }

  asio::io_context loop;
  VirtualClock clock{loop};
  runtime::TaskGroup tasks{loop};
  std::unique_ptr<net::PollSet> set = std::make_unique<net::PollSet>(loop, clock);
  std::vector<std::unique_ptr<Line>> lines;
  std::vector<int> received;
  std::vector<std::string> waits_ended;
};

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
  lines.back()->socket().set_awaited(true);
  all_say();
  clock.settle();
  EXPECT_THAT(received, ::testing::ElementsAre(static_cast<int>(lines.size()) - 1)) << "the others are in their pause";
  clock.run_for(net::PollSet::kPause);
  clock.settle();
  EXPECT_EQ(received.size(), lines.size());

  received.clear();
  clock.run_for(1s);  // a look is due, and takes them eight at a time
  all_say();
  lines.back()->socket().set_awaited(false);
  lines[0]->socket().set_awaited(true);
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
  lines[0]->socket().set_awaited(true);
  lines[0]->socket().set_awaited(false);
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
  lines[0]->socket().set_awaited(true);
  clock.settle();
  EXPECT_EQ(received, std::vector<int>{0});
  lines[0]->say('x');
  lines[0]->socket().set_awaited(false);
  clock.settle();
  EXPECT_EQ(received, std::vector<int>{0});
  clock.run_for(net::PollSet::kPause);
  EXPECT_EQ(received.size(), 3U);
}

TEST_F(PollSetTest, AnEventThatNobodyWatchesDoesNotKeepTheLoopBusy) {
  add_lines(2);
  lines[0]->socket().set_awaited(true);
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
