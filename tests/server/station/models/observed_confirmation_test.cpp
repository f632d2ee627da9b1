// What batches and pages show of a robot's confirmation.
#include "server/station/models/observed_confirmation.hpp"

#include <gtest/gtest.h>

namespace server {
namespace {

constexpr std::int64_t kSecondUs = 1'000'000;

TEST(ObservedConfirmationTest, OnlyAnotherFlagOrBootIsNew) {
  station::ObservedConfirmation seen;
  EXPECT_FALSE(seen.flag().has_value());
  EXPECT_TRUE(seen.on_flag(7, false, 0));
  EXPECT_FALSE(seen.on_flag(7, false, 1));
  EXPECT_TRUE(seen.on_flag(7, true, 2));
  EXPECT_TRUE(seen.on_flag(8, true, 3));
  EXPECT_EQ(seen.boot_id(), 8U);
}

TEST(ObservedConfirmationTest, AFlagThatWasNotKnownBeforeWasNotSeenToRise) {
  station::ObservedConfirmation seen;
  seen.on_flag(7, true, 0);
  EXPECT_FALSE(seen.was_seen_to_rise());
  seen.on_flag(7, false, 1);
  seen.on_flag(7, true, 2);
  EXPECT_TRUE(seen.was_seen_to_rise());
  seen.on_flag(8, true, 3);
  EXPECT_FALSE(seen.was_seen_to_rise()) << "in another boot";
}

// SAFETY's test: what happened while the link was cut, nobody knows.
TEST(ObservedConfirmationTest, ALostLinkLeavesNoFlag) {
  station::ObservedConfirmation seen;
  seen.on_flag(7, false, 0);
  seen.on_disconnected();
  EXPECT_FALSE(seen.flag().has_value());
  EXPECT_TRUE(seen.on_flag(7, true, 1));
  EXPECT_FALSE(seen.was_seen_to_rise());
}

TEST(ObservedConfirmationTest, AFlagIsOlderThanAPageUntilASampleAfterItOrForFiveSeconds) {
  station::ObservedConfirmation seen;
  seen.on_flag(7, true, 0);
  EXPECT_FALSE(seen.is_older_than_page(100, 10 * kSecondUs)) << "there is none";
  seen.on_page(100, 10 * kSecondUs);
  EXPECT_TRUE(seen.is_older_than_page(100, 11 * kSecondUs));
  EXPECT_FALSE(seen.is_older_than_page(101, 11 * kSecondUs));
  EXPECT_FALSE(seen.is_older_than_page(100, 15 * kSecondUs));
  seen.on_flag(8, true, 11 * kSecondUs);
  EXPECT_FALSE(seen.is_older_than_page(5, 11 * kSecondUs)) << "of another boot";
}

TEST(ObservedConfirmationTest, AFlagIsNewForFiveSeconds) {
  station::ObservedConfirmation seen;
  seen.on_flag(7, true, kSecondUs);
  seen.on_flag(7, true, 3 * kSecondUs);  // the same
  EXPECT_TRUE(seen.is_new(6 * kSecondUs - 1));
  EXPECT_FALSE(seen.is_new(6 * kSecondUs));
}

}  // namespace
}  // namespace server
