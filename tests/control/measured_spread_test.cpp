// The spread of a measured position: what a loop makes of it, and what it leaves alone.
#include "control/responses/measured_spread.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace control {
namespace {

constexpr std::size_t kTicks = 2000;

// A robot that stands still, by a model of one lag.
LoopParts parts_with(double gain_per_m) {
  LoopParts parts;
  parts.gain_m_s[0] = parts.estimate.gain_m_s[0] = 0.1;
  parts.time_constant_s[0] = parts.estimate.time_constant_s[0] = 0.1;
  parts.estimate.is_confirmed = true;
  parts.controller.direct = gain_per_m;
  return parts;
}
LoopMotion still(LoopTick tick) {
  return {std::vector<double>(kTicks), std::vector<double>(kTicks), std::vector<LoopTick>(kTicks, tick)};
}

TEST(MeasuredSpread, InALoopIsHeldWhileTheTruePositionDrifts) {
  const MeasuredSpread spread = measured_spread(still(LoopTick::acts), parts_with(30));
  EXPECT_LT(spread.start_m.back(), 1e-6);
  EXPECT_GT(spread.true_m.back(), 5e-5);
  EXPECT_LT(spread.sensor_m.back(), spread.true_m.back() / 2);
  EXPECT_NEAR(spread.sensor_m.back(), spread.sensor_m[kTicks / 2], 0.1 * spread.sensor_m.back());
  EXPECT_GT(spread.true_m.back(), spread.true_m[kTicks / 2]);
}

TEST(MeasuredSpread, WithoutALoopOfAStillRobotIsTheErrorOfItsEstimate) {
  const MeasuredSpread spread = measured_spread(still(LoopTick::duty_given), parts_with(30));
  EXPECT_GT(spread.sensor_m.back(), 1.2 * spread.sensor_m[kTicks / 2]) << "nothing holds it";
  EXPECT_EQ(spread.true_m.back(), 0) << "nothing moves it";
  const MeasuredSpread clipped = measured_spread(still(LoopTick::clipped), parts_with(30));
  EXPECT_EQ(clipped.sensor_m.back(), spread.sensor_m.back()) << "a clipped duty acts on nothing";
}

TEST(MeasuredSpread, OfAConfirmedModelThatIsExactTheEstimatorAddsNothing) {
  LoopMotion motion = still(LoopTick::acts);
  std::ranges::fill(motion.duty, 0.1);
  std::ranges::fill(motion.velocity_m_s, 0.01);
  LoopParts parts = parts_with(30);
  EXPECT_EQ(std::ranges::max(measured_spread(motion, parts).estimator_m), 0);
  parts.model_error = 0.005;
  const double little_m = measured_spread(motion, parts).estimator_m.back();
  parts.model_error = 0.01;
  EXPECT_NEAR(measured_spread(motion, parts).estimator_m.back(), 2 * little_m, 1e-9) << "in proportion to its error";
  EXPECT_GT(little_m, 0);
  parts.estimate.is_confirmed = false;
  EXPECT_GT(measured_spread(motion, parts).estimator_m.back(), 10 * little_m);
}

TEST(MeasuredSpread, RefusesColumnsOfDifferentLengths) {
  LoopMotion motion = still(LoopTick::acts);
  motion.duty.pop_back();
  EXPECT_THROW(measured_spread(motion, parts_with(30)), std::invalid_argument);
}

}  // namespace
}  // namespace control
