// The reference moves within its limits and ends on the setpoint.
#include "robot_fw/core/reference_profile.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace robot_fw {
namespace {

constexpr float kDtS = 0.01F;

std::vector<float> references(float from_m, float to_m, ProfileLimits limits, int ticks) {
  ReferenceProfile profile;
  std::vector<float> all;
  for (int i = 0; i < ticks; ++i) all.push_back(profile.step(to_m, from_m, limits, kDtS));
  return all;
}

TEST(ReferenceProfile, WithoutLimitsIsTheSetpointAtOnce) {
  EXPECT_EQ(references(0.03F, 0.1F, {}, 1), std::vector<float>{0.1F});
}

TEST(ReferenceProfile, StartsAtTheMeasuredPosition) {
  EXPECT_EQ(references(0.03F, 0.1F, {0.05F, 0.1F}, 1), std::vector<float>{0.03F});
}

TEST(ReferenceProfile, KeepsItsLimitsAndEndsOnTheSetpoint) {
  const ProfileLimits cases[] = {{0.05F, 0.1F}, {0.05F, 0}, {0, 0.1F}, {10, 100}, {0.001F, 0.5F}, {0.3F, 0.01F}};
  for (const ProfileLimits& limits : cases) {
    for (const float to_m : {0.1F, -0.1F, 0.0001F, 0.7F, 0.02F}) {
      const auto r = references(0.02F, to_m, limits, 80'000);
      EXPECT_EQ(r.back(), to_m);
      float before_m_s = 0;
      for (std::size_t i = 1; i < r.size(); ++i) {
        const float v_m_s = (r[i] - r[i - 1]) / kDtS;
        if (limits.velocity_m_s > 0) ASSERT_LE(std::fabs(v_m_s), limits.velocity_m_s * 1.01F + 1e-4F);
        if (limits.acceleration_m_s2 > 0) {
          ASSERT_LE(std::fabs(v_m_s - before_m_s), limits.acceleration_m_s2 * kDtS * 1.02F + 2e-4F) << i << ' ' << to_m;
        }
        ASSERT_GE(v_m_s * (to_m - 0.02F), 0) << "never back";
        ASSERT_LE(std::fabs(r[i] - 0.02F), std::fabs(to_m - 0.02F) + 1e-6F) << "never beyond";
        before_m_s = v_m_s;
      }
    }
  }
}

TEST(ReferenceProfile, TakesTheTimeOfATrapezoid) {
  const auto r = references(0, 0.1F, {0.05F, 0.1F}, 1000);  // 0.1/0.05 + 0.05/0.1 = 2.5 s
  EXPECT_LT(r[240], 0.1F);
  EXPECT_EQ(r[256], 0.1F);
}

TEST(ReferenceProfile, RestartsOnRequest) {
  ReferenceProfile profile;
  for (int i = 0; i < 100; ++i) profile.step(0.1F, 0, {0.05F, 0.1F}, kDtS);
  profile.restart();
  EXPECT_EQ(profile.step(-0.1F, 0.02F, {0.05F, 0.1F}, kDtS), 0.02F);
}

}  // namespace
}  // namespace robot_fw
