// Times on the command line of reservations: durations, and moments in UTC.
#include <gtest/gtest.h>

#include "server/cli/accounts/robot_reservations.hpp"

namespace server {
namespace {

TEST(ReservationTimes, ADurationHasItsUnitsOnceAndInOrder) {
  EXPECT_EQ(cli::seconds_of("30s"), 30);
  EXPECT_EQ(cli::seconds_of("90min"), 5400);
  EXPECT_EQ(cli::seconds_of("1d2h3min4s"), 86'400 + 7200 + 180 + 4);
  for (const char* wrong :
       {"", "2", "h", "0s", "-1h", "1.5h", "1h2", "1h1h", "3min2h", "1m", "1 h", "9999999999999999999s"}) {
    EXPECT_EQ(cli::seconds_of(wrong), std::nullopt) << wrong;
  }
}

TEST(ReservationTimes, AMomentIsADateAndATimeInUtc) {
  EXPECT_EQ(cli::utc_us_of("1970-01-02T00:00Z"), 86'400'000'000);
  EXPECT_EQ(cli::utc_us_of("2026-11-26T09:00Z"), 1'795'683'600'000'000);
  EXPECT_EQ(cli::utc_us_of("2026-11-26T09:00:59Z"), 1'795'683'659'000'000);
  EXPECT_EQ(cli::utc_us_of("2028-02-29T23:59Z"), 1'835'481'540'000'000);
  for (const char* wrong :
       {"", "tomorrow", "2026-11-26", "2026-11-26T09:00", "2026-11-26T09Z", "2026-11-26 09:00Z", "2026-02-30T09:00Z",
        "2027-02-29T09:00Z", "2026-11-26T24:00Z", "2026-11-26T09:60Z", "2026-11-26T09:00:60Z", "2026-11-26T09:00Z+1"}) {
    EXPECT_EQ(cli::utc_us_of(wrong), std::nullopt) << wrong;
  }
}

}  // namespace
}  // namespace server
