// The histogram of lateness against a sorted list.
#include "sim_robot/client/lateness.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace sim_robot {
namespace {

TEST(Lateness, HasNoneWithoutTicks) {
  const Lateness lateness;
  EXPECT_EQ(lateness.quantile_ms(0.99), 0);
  EXPECT_EQ(lateness.max_ms(), 0);
}

TEST(Lateness, QuantilesAreWithin7PercentOfTheTrueOnes) {
  std::mt19937_64 random{1};
  std::lognormal_distribution<double> late_us{6, 2};
  Lateness lateness;
  std::vector<double> all_ms;
  for (int i = 0; i < 20000; ++i) {
    const auto us = static_cast<std::int64_t>(late_us(random));
    lateness.add(us);
    all_ms.push_back(static_cast<double>(us) / 1000);
  }
  std::sort(all_ms.begin(), all_ms.end());
  for (const double share : {0.01, 0.5, 0.9, 0.99, 0.999}) {
    const double exact_ms = all_ms[static_cast<std::size_t>(share * 20000) - 1];
    EXPECT_GE(lateness.quantile_ms(share), exact_ms) << share;
    EXPECT_LE(lateness.quantile_ms(share), 1.07 * exact_ms + 0.001) << share;
  }
  EXPECT_EQ(lateness.max_ms(), all_ms.back());
  EXPECT_EQ(lateness.quantile_ms(1), all_ms.back());
  EXPECT_EQ(lateness.count(), 20000u);
}

TEST(Lateness, TakesEarlyTicksAsInTimeAndVeryLateOnesAsTheMost) {
  Lateness lateness;
  lateness.add(-5);
  EXPECT_EQ(lateness.max_ms(), 0);
  lateness.add(std::int64_t{1} << 40);
  EXPECT_EQ(lateness.max_ms(), 2147483.647);
  EXPECT_EQ(lateness.quantile_ms(1), 2147483.647);
}

}  // namespace
}  // namespace sim_robot
