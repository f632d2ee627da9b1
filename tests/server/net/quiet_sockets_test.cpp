// Sockets for whose bytes nobody waits: when they are read, and that they are read at once when somebody does.
#include <boost/asio/post.hpp>

#include "tests/server/net/poll_set_fixture.hpp"

namespace server {
namespace {

class QuietSocketsTest : public PollSetTest {};

TEST_F(QuietSocketsTest, TheQuietAreReadOncePerQuietPause) {
  add_quiet_lines(3);
  all_say();
  clock.run_for(net::PollSet::kQuietPause - 1us);
  EXPECT_TRUE(received.empty());
  all_say();
  clock.run_for(1us);
  clock.settle();
  EXPECT_EQ(received.size(), 3U) << "a call takes one byte";
  clock.run_for(net::PollSet::kQuietPause - 1us);
  EXPECT_EQ(received.size(), 3U);
  clock.run_for(1us);
  clock.settle();
  EXPECT_EQ(received.size(), 6U);
}

// However they were spread over the pause, the loop wakes once for those that are due within a round.
TEST_F(QuietSocketsTest, TheQuietAreReadInRounds) {
  for (int i = 0; i < 20; ++i) {
    add_quiet_lines(1);
    clock.run_for(net::PollSet::kPause / 20);
  }
  all_say();
  std::vector<std::size_t> seen;
  while (received.size() < lines.size()) {
    clock.run_for(100us);
    if (seen.empty() || seen.back() != received.size()) seen.push_back(received.size());
  }
  EXPECT_LE(seen.size(), 3U) << "nothing, the first, the others a pause later";
  EXPECT_GT(seen.size(), 1U);
}

// SAFETY: what the answer of a robot that nobody watched rests on.
TEST_F(QuietSocketsTest, AQuietOneThatIsAwaitedWaitsForNoPause) {
  add_quiet_lines(2);
  all_say();
  clock.settle();
  EXPECT_TRUE(received.empty());
  lines[0]->socket().set_pace(net::ReadPace::awaited);
  clock.settle();
  EXPECT_EQ(received, std::vector<int>{0}) << "what had come";
  lines[0]->say('x');
  clock.settle();
  EXPECT_EQ(received, (std::vector<int>{0, 0}));
  lines[0]->socket().set_pace(net::ReadPace::quiet);
  lines[0]->say('x');
  clock.run_for(net::PollSet::kQuietPause - 1us);
  EXPECT_EQ(received, (std::vector<int>{0, 0})) << "the other is due";
  clock.run_for(1us);
  clock.settle();
  EXPECT_EQ(received, (std::vector<int>{0, 0, 1, 0}));
}

TEST_F(QuietSocketsTest, WhoIsNoLongerQuietIsReadWithTheOthers) {
  add_quiet_lines(1);
  lines[0]->say('x');
  clock.settle();
  EXPECT_TRUE(received.empty());
  lines[0]->socket().set_pace(net::ReadPace::prompt);
  clock.settle();
  EXPECT_EQ(received, std::vector<int>{0});
}

// Nobody's bytes can have come unseen: its owner finds out by the call whether it is still quiet.
TEST_F(QuietSocketsTest, AQuietOneIsCalledAlsoWithoutBytes) {
  add_lines(1);
  int calls = 0;
  lines[0]->socket().watch([&] { ++calls; });
  lines[0]->socket().set_pace(net::ReadPace::quiet);
  clock.run_for(10 * net::PollSet::kQuietPause + net::PollSet::kPause);
  EXPECT_EQ(calls, 10);
  lines[0]->socket().watch(nullptr);
  clock.run_for(1s);
  EXPECT_EQ(calls, 10);
}

TEST_F(QuietSocketsTest, TheEndOfAQuietConnectionIsReportedAtOnce) {
  for (const bool is_half_open : {false, true}) {
    add_quiet_lines(1);
    Line& line = *lines.back();
    bool has_ended = false;
    line.socket().watch([&] {
      if (!line.take()) has_ended = true;
    });
    is_half_open ? line.end_sending() : line.hang_up();
    clock.settle();
    EXPECT_TRUE(has_ended) << is_half_open;
    line.leave();
    clock.run_for(1s);
  }
}

TEST_F(QuietSocketsTest, EverybodyElseHasATurnAfterAFewOfTheQuiet) {
  add_quiet_lines(10 * net::PollSet::kQuietAtOnce);
  all_say();
  std::vector<std::size_t> seen;
  std::function<void()> step = [&] {
    seen.push_back(received.size());
    if (received.size() < lines.size()) asio::post(loop, step);
  };
  lines[0]->socket().watch([&] {
    received.push_back(0);
    if (seen.empty()) asio::post(loop, step);
  });
  clock.run_for(net::PollSet::kQuietPause);
  clock.settle();
  EXPECT_EQ(received.size(), lines.size());
  ASSERT_GE(seen.size(), 10U);
  for (std::size_t i = 1; i < seen.size(); ++i) {
    EXPECT_LE(seen[i] - seen[i - 1], std::size_t{net::PollSet::kQuietAtOnce});
  }
}

TEST_F(QuietSocketsTest, AQuietOneMayLeaveInItsOwnTurnAndInThatOfAnother) {
  add_quiet_lines(3);
  lines[0]->socket().watch([&] {
    received.push_back(0);
    lines[0]->socket().set_pace(net::ReadPace::prompt);
    lines[1]->leave();
  });
  clock.run_for(3 * net::PollSet::kQuietPause);
  EXPECT_EQ(received, std::vector<int>{0}) << "the third has said nothing";
  lines[2]->say('x');
  set.reset();
  lines.clear();
}

}  // namespace
}  // namespace server
