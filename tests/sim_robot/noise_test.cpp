// The random numbers have the moments and the tails that they should, and are the same for ever.
#include "sim_robot/world/noise.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace sim_robot {
namespace {

constexpr int kDraws = 200'000;

TEST(Noise, IsUniformBetween0And1) {
  Noise noise{1};
  double sum = 0, squares = 0;
  for (int k = 0; k < kDraws; ++k) {
    const double value = noise.uniform();
    ASSERT_GE(value, 0);
    ASSERT_LT(value, 1);
    sum += value;
    squares += value * value;
  }
  EXPECT_NEAR(sum / kDraws, 0.5, 0.003);
  EXPECT_NEAR(squares / kDraws, 1.0 / 3, 0.003);
}

TEST(Noise, IsNormalWithItsTailsAndWithoutMemory) {
  Noise noise{2};
  double sum = 0, squares = 0, fourth = 0, products = 0, before = 0;
  int beyond_2 = 0, beyond_3 = 0;
  for (int k = 0; k < kDraws; ++k) {
    const double value = noise.normal();
    sum += value;
    squares += value * value;
    fourth += value * value * value * value;
    products += value * before;
    before = value;
    beyond_2 += std::abs(value) > 2;
    beyond_3 += std::abs(value) > 3;
  }
  EXPECT_NEAR(sum / kDraws, 0, 0.01);
  EXPECT_NEAR(squares / kDraws, 1, 0.015);
  EXPECT_NEAR(fourth / kDraws, 3, 0.12);
  EXPECT_NEAR(products / kDraws, 0, 0.01);
  EXPECT_NEAR(beyond_2, 0.0455 * kDraws, 400);
  EXPECT_NEAR(beyond_3, 0.0027 * kDraws, 110);
}

TEST(Noise, NeighbouringSeedsHaveNothingInCommon) {
  Noise one{1}, two{2};
  double products = 0;
  for (int k = 0; k < kDraws; ++k) products += one.normal() * two.normal();
  EXPECT_NEAR(products / kDraws, 0, 0.01);
}

}  // namespace
}  // namespace sim_robot
