// How often a robot dials a station that does not answer.
#include "sim_robot/network/redial.hpp"

#include <gtest/gtest.h>

#include <set>

namespace sim_robot {
namespace {

using namespace std::chrono_literals;

class RedialTest : public ::testing::Test {
 protected:
  // The shortest and the longest of many pauses.
  std::pair<Redial::Milliseconds, Redial::Milliseconds> pauses(bool ring_has_room) {
    std::set<Redial::Milliseconds> seen;
    for (int i = 0; i < 1000; ++i) seen.insert(redial.next(random, ring_has_room));
    return {*seen.begin(), *seen.rbegin()};
  }

  Redial redial;
  std::minstd_rand random{1};
};

TEST_F(RedialTest, AttemptsBeginAtMostASecondApartWhileTheRingHasRoom) {
  const auto [shortest, longest] = pauses(true);
  EXPECT_LE(std::max(longest, Redial::kConnectTimeout), 1s);
  EXPECT_GT(longest - shortest, 400ms) << "robots that lost one station do not come back at once";
}

TEST_F(RedialTest, PausesGrowToFourTimesOnceTheRingIsFull) {
  EXPECT_LE(redial.next(random, false), Redial::kLongest);
  const auto [shortest, longest] = pauses(false);
  EXPECT_GT(longest, 3 * Redial::kLongest);
  EXPECT_LE(longest, 4 * Redial::kLongest);
  EXPECT_GE(shortest, Redial::kShortest);
}

TEST_F(RedialTest, PausesAreShortAgainAfterAWelcomeAndWithRoomInTheRing) {
  pauses(false);
  redial.welcomed();
  EXPECT_LE(redial.next(random, false), Redial::kLongest);
  pauses(false);
  EXPECT_LE(redial.next(random, true), Redial::kLongest);
}

}  // namespace
}  // namespace sim_robot
