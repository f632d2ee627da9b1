// A limited reference keeps its limits and arrives exactly.
#include "control/models/reference_profile.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace control {
namespace {

TEST(ReferenceProfile, KeepsItsLimitsAndEndsAtTheSetpointWithoutPassingIt) {
  constexpr double kStepS = 1e-3;
  for (const double distance_m : {0.1, -0.1, 0.005}) {
    const ReferenceProfile profile{distance_m, 0.06, 0.25};
    const double sign = distance_m > 0 ? 1 : -1;
    double last_m = 0, last_velocity_m_s = 0;
    for (int k = 1; k <= 4000; ++k) {
      const double now_m = sign * profile.position_m(k * kStepS), velocity_m_s = (now_m - last_m) / kStepS;
      ASSERT_GE(velocity_m_s, -1e-9);
      ASSERT_LE(velocity_m_s, 0.06 + 1e-9);
      ASSERT_LE(std::abs(velocity_m_s - last_velocity_m_s), 0.25 * kStepS + 1e-9);
      ASSERT_LE(now_m, std::abs(distance_m));
      last_m = now_m;
      last_velocity_m_s = velocity_m_s;
    }
    EXPECT_EQ(last_m, std::abs(distance_m));
  }
}

TEST(ReferenceProfile, IsAStepWithoutLimitsAndARampWithoutAcceleration) {
  EXPECT_EQ(ReferenceProfile(0.1, 0, 0).position_m(0), 0.1);
  EXPECT_NEAR(ReferenceProfile(0.1, 0.05, 0).position_m(1), 0.05, 1e-15);
  EXPECT_NEAR(ReferenceProfile(0.1, 0, 0.4).position_m(0.5), 0.05, 1e-15);
  EXPECT_EQ(ReferenceProfile(0, 0.05, 0.4).position_m(1), 0);
}

TEST(ReferenceProfile, RefusesNegativeLimits) {
  EXPECT_THROW(ReferenceProfile(0.1, -1, 0), std::invalid_argument);
  EXPECT_THROW(ReferenceProfile(0.1, 1, std::nan("")), std::invalid_argument);
}

}  // namespace
}  // namespace control
