// Recordings cut into steps.
#include "server/analysis/run_steps.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace server {
namespace {

// A recording at 100 Hz, made piece by piece.
class RunStepsTest : public ::testing::Test {
 protected:
  // The position approaches the setpoint with a time constant of 0.1 s.
  void steer(float setpoint_m, float disturbance_m, int samples) {
    position_m_ += disturbance_m - disturbance_m_;
    disturbance_m_ = disturbance_m;
    for (int i = 0; i < samples; ++i) {
      add(setpoint_m, true);
      position_m_ += 0.1F * (setpoint_m - position_m_);
    }
  }
  void rest(int samples) {
    for (int i = 0; i < samples; ++i) add(0, false);
  }
  void add(float setpoint_m, bool steered) {
    points.push_back({span, next_seq, 7'000'000 + next_seq * 10'000, position_m_, disturbance_m_, setpoint_m, steered,
                      position_sd_m});
    ++next_seq;
  }

  std::vector<StepPoint> points;
  std::uint32_t span = 0;
  std::uint64_t next_seq = 0;
  float position_sd_m = 0;

 private:
  float position_m_ = 0;
  float disturbance_m_ = 0;
};

TEST_F(RunStepsTest, SaysHowUncertainAnEstimatedPositionWas) {
  rest(50);
  position_sd_m = 0.001F;
  steer(0.1F, 0, 500);
  position_sd_m = 0.003F;
  steer(0.1F, 0, 500);
  position_sd_m = 0.002F;
  steer(0.2F, 0, 1000);
  const auto steps = measure_steps(points);
  ASSERT_EQ(steps.size(), 2U);
  EXPECT_FLOAT_EQ(static_cast<float>(steps[0].position_sd_m), 0.003F);
  EXPECT_FLOAT_EQ(static_cast<float>(steps[1].position_sd_m), 0.002F);
}

TEST_F(RunStepsTest, MeasuresSetpointsAndDisturbances) {
  rest(50);
  steer(0.1F, 0, 1000);
  steer(0.1F, -0.05F, 1000);
  steer(0.2F, -0.05F, 1000);
  rest(10);
  const auto steps = measure_steps(points);
  ASSERT_EQ(steps.size(), 3U);
  EXPECT_EQ(steps[0].cause, StepCause::setpoint);
  EXPECT_EQ(steps[0].first_seq, 50U);
  EXPECT_EQ(steps[0].last_seq, 1049U);
  EXPECT_NEAR(steps[0].at_s, 0.5, 1e-9);
  EXPECT_NEAR(*steps[0].metrics.settling_s, 0.38, 1e-9);  // 0.9^38 is the first power of 0.9 below 0.02
  EXPECT_EQ(steps[1].cause, StepCause::disturbance);
  EXPECT_NEAR(steps[1].start_m, 0.05, 1e-6);
  EXPECT_NEAR(steps[1].band_m, 0.002, 1e-9);
  EXPECT_NEAR(steps[1].metrics.steady_state_error_m, 0, 1e-6);
  EXPECT_EQ(steps[2].cause, StepCause::setpoint);
  EXPECT_NEAR(steps[2].start_m, 0.1, 1e-6);
}

TEST_F(RunStepsTest, ANewSpanIsANewStep) {
  steer(0.1F, 0, 100);
  span = 1;
  next_seq = 0;
  steer(0.3F, 0, 100);
  const auto steps = measure_steps(points);
  ASSERT_EQ(steps.size(), 2U);
  EXPECT_EQ(steps[1].span, 1U);
  EXPECT_EQ(steps[1].at_s, 0);
}

TEST_F(RunStepsTest, AnUnusablePositionEndsTheStep) {
  steer(0.1F, 0, 100);
  points[50].position_m = std::numeric_limits<float>::quiet_NaN();
  const auto steps = measure_steps(points);
  ASSERT_EQ(steps.size(), 2U);
  EXPECT_EQ(steps[0].last_seq, 49U);
  EXPECT_EQ(steps[1].first_seq, 51U);
}

TEST_F(RunStepsTest, NothingSteeredIsNoStep) {
  EXPECT_TRUE(measure_steps(points).empty());
  rest(100);
  steer(0, 0, 100);  // holds where it is
  EXPECT_TRUE(measure_steps(points).empty());
}

}  // namespace
}  // namespace server
