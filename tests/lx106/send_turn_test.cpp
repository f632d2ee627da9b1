// How much goes out after one tick.
#include "tests/lx106/send_turn.hpp"

#include <gtest/gtest.h>

#include "protocol/messages.hpp"

namespace robot_fw {
namespace {

static_assert(rheonaut_Event_size + 15 < SendTurn::kLongFrameBytes, "an event in its frame counts as long");

TEST(SendTurn, EndsWhenNothingIsDue) {
  SendTurn turn;
  EXPECT_TRUE(turn.goes_on());
  turn.sent(0);
  EXPECT_FALSE(turn.goes_on());
}

TEST(SendTurn, EndsAfterALongFrame) {
  SendTurn turn;
  turn.sent(30);
  EXPECT_TRUE(turn.goes_on());
  turn.sent(SendTurn::kLongFrameBytes);
  EXPECT_FALSE(turn.goes_on());
}

TEST(SendTurn, EndsAfterThreeShortFrames) {
  SendTurn turn;
  for (int i = 0; i < SendTurn::kMaxFrames; ++i) {
    EXPECT_TRUE(turn.goes_on());
    turn.sent(30);
  }
  EXPECT_FALSE(turn.goes_on());
}

}  // namespace
}  // namespace robot_fw
