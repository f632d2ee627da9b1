// The last lines of defence, each alone: they hold even where the lines before them would have.
#include "robot_fw/core/safety.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "robot_fw/core/pilot.hpp"

namespace robot_fw {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();

TEST(Safety, PermitsOnlyFiniteDutiesWithinTheRange) {
  const Safety safety{{-0.5F, 0.8F}, 1};
  EXPECT_EQ(safety.permit(0.3F), 0.3F);
  EXPECT_EQ(safety.permit(-7), -0.5F);
  EXPECT_EQ(safety.permit(7), 0.8F);
  EXPECT_EQ(safety.permit(kNan), 0);
  EXPECT_EQ(safety.permit(kInf), 0);
  EXPECT_EQ(safety.permit(-kInf), 0);
}

TEST(Safety, OutsideThePositionLimitsPermitsNothingThatLeadsFurtherOut) {
  Safety safety{{-1, 1}, 1};
  const PositionLimits limits{-0.2F, 0.1F};
  EXPECT_FALSE(safety.leaves_limits(0.1F, limits));
  EXPECT_TRUE(safety.leaves_limits(0.11F, limits));
  EXPECT_FALSE(safety.leaves_limits(0.12F, limits)) << "only once";
  EXPECT_EQ(safety.permit(0.3F), 0);
  EXPECT_EQ(safety.permit(-0.3F), -0.3F);
  safety.leaves_limits(kNan, limits);
  EXPECT_EQ(safety.permit(0.3F), 0);
  EXPECT_TRUE(safety.leaves_limits(-0.21F, limits));
  EXPECT_EQ(safety.permit(-0.3F), 0);
  EXPECT_EQ(safety.permit(0.3F), 0.3F);
  EXPECT_FALSE(safety.leaves_limits(0, limits));
  EXPECT_EQ(safety.permit(-0.3F), -0.3F);
}

TEST(Safety, PermitsNothingWhileLatched) {
  Safety safety{{-1, 1}, 1};
  safety.latch(rheonaut_EMERGENCY_CAUSE_OPERATOR);
  EXPECT_EQ(safety.permit(0.3F), 0);
  EXPECT_FALSE(safety.clear(safety.emergency_id() + 1));
  EXPECT_EQ(safety.permit(0.3F), 0);
  EXPECT_TRUE(safety.clear(safety.emergency_id()));
  EXPECT_EQ(safety.permit(0.3F), 0.3F);
  EXPECT_FALSE(safety.clear(0));
}

TEST(Safety, NeverGivesALatchTheSameIdTwice) {
  std::set<std::uint64_t> ids{0};
  for (std::uint64_t boot_id = 1; boot_id <= 20; ++boot_id) {
    Safety safety{{-1, 1}, boot_id};
    for (int i = 0; i < 500; ++i) {
      safety.latch(rheonaut_EMERGENCY_CAUSE_OPERATOR);
      EXPECT_TRUE(ids.insert(safety.emergency_id()).second);
    }
  }
}

TEST(Pilot, ALeaseThatRanOutSinceTheLastTickCannotBeRenewed) {
  Pilot pilot;
  pilot.set_duty(0.5F, 500, 1'000);
  EXPECT_TRUE(pilot.renew_lease(500, 500'999));
  EXPECT_FALSE(pilot.renew_lease(500, 1'000'999));
  EXPECT_EQ(pilot.tick(1'000'999), Pilot::Lapse::lease);
  EXPECT_EQ(pilot.manual_duty(), 0);
}

}  // namespace
}  // namespace robot_fw
