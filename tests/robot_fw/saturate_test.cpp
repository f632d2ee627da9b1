// Every float has an integer.
#include "robot_fw/core/saturate.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace robot_fw {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

template <class Integer>
class Saturated : public testing::Test {
 protected:
  using Limits = std::numeric_limits<Integer>;
};
using Integers = testing::Types<std::int32_t, std::uint32_t, std::uint64_t>;
TYPED_TEST_SUITE(Saturated, Integers);

TYPED_TEST(Saturated, NotANumberIsZero) {
  EXPECT_EQ(saturated<TypeParam>(NAN), TypeParam{0});
  EXPECT_EQ(saturated<TypeParam>(-NAN), TypeParam{0});
}

TYPED_TEST(Saturated, WhatDoesNotFitIsTheLimit) {
  using Limits = typename TestFixture::Limits;
  const float above = std::ldexp(1.0F, Limits::digits);
  for (const float value : {above, std::nextafter(above, kInfinity), 1e38F, kInfinity}) {
    EXPECT_EQ(saturated<TypeParam>(value), Limits::max()) << value;
  }
  for (const float value : {-above, -1e38F, -kInfinity}) EXPECT_EQ(saturated<TypeParam>(value), Limits::min()) << value;
}

TYPED_TEST(Saturated, TheLargestFloatBelowTheLimitIsExact) {
  const float below = std::nextafter(std::ldexp(1.0F, TestFixture::Limits::digits), 0.0F);
  EXPECT_EQ(static_cast<float>(saturated<TypeParam>(below)), below);
}

TYPED_TEST(Saturated, FractionsAreCutTowardsZero) {
  EXPECT_EQ(saturated<TypeParam>(0.99F), TypeParam{0});
  EXPECT_EQ(saturated<TypeParam>(-0.99F), TypeParam{0});
  EXPECT_EQ(saturated<TypeParam>(1e-45F), TypeParam{0});
  EXPECT_EQ(saturated<TypeParam>(10'000.5F), TypeParam{10'000});
}

TEST(SaturatedSigned, KeepsTheSign) { EXPECT_EQ(saturated<std::int32_t>(-10'000.5F), -10'000); }

TEST(SaturatedUnsigned, BelowZeroIsZero) { EXPECT_EQ(saturated<std::uint32_t>(-1.5F), 0u); }

}  // namespace
}  // namespace robot_fw
