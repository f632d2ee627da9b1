// What waits for one who watches, and what is dropped when it does not read.
#include "server/live/subscriber.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <vector>

namespace server {
namespace {

live::LiveText message(const std::string& text) { return std::make_shared<const std::string>(text); }

// The states of a fleet leave a slow page something else to read.
TEST(Subscriber, StatesAndTheRestTakeTurns) {
  boost::asio::io_context loop;
  live::Subscriber listener{loop};
  for (int i = 0; i < 100; ++i) listener.push_state(std::to_string(i), message("state"));
  for (int i = 0; i < 3; ++i) listener.push(message("samples"), true);
  std::vector<std::string> first;
  for (int i = 0; i < 6; ++i) first.push_back(*listener.pop());
  EXPECT_EQ(std::ranges::count(first, "samples"), 3);
  EXPECT_EQ(first.front(), "state");
}

TEST(Subscriber, HoldsAtMostAMegabyte) {
  boost::asio::io_context loop;
  live::Subscriber listener{loop};
  for (int i = 0; i < 20; ++i) listener.push(message(std::string(100'000, 'x')), i % 2 == 0);
  EXPECT_EQ(listener.size(), 10U);
}

TEST(Subscriber, DropsWhatIsOldestWhenThereAreNoSamples) {
  boost::asio::io_context loop;
  live::Subscriber listener{loop};
  for (std::size_t i = 0; i <= live::Subscriber::kMaxMessages; ++i) listener.push(message(std::to_string(i)), false);
  EXPECT_EQ(*listener.pop(), R"({"count":1,"type":"dropped"})");
  EXPECT_EQ(*listener.pop(), "1");
}

// Of robots that were sent by another way, in order of their ids; a newer state of them waits again.
TEST(Subscriber, ForgetsTheStatesOfARangeOfRobots) {
  boost::asio::io_context loop;
  live::Subscriber listener{loop};
  for (const char* robot : {"d", "b", "a", "c"}) listener.push_state(robot, message(robot));
  listener.push(message("event"), false);
  listener.forget_states("a", "c");
  listener.forget_states("x", "x");
  listener.push_state("b", message("newer b"));
  std::vector<std::string> all;
  for (live::LiveText text = listener.pop(); text != nullptr; text = listener.pop()) all.push_back(*text);
  EXPECT_EQ(all, (std::vector<std::string>{"d", "event", "a", "newer b"}));
}

}  // namespace
}  // namespace server
