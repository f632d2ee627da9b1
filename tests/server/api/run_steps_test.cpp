// Recordings cut into steps.
#include "server/analysis/metrics/run_steps.hpp"

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
  void position_at(float position_m) { position_m_ = position_m; }
  void rest(int samples) {
    for (int i = 0; i < samples; ++i) add(0, false);
  }
  void add(float setpoint_m, bool steered) {
    points.push_back({span, next_seq, 7'000'000 + next_seq * 10'000, position_m_, disturbance_m_, setpoint_m, steered,
                      position_sd_m});
    ++next_seq;
  }

  std::vector<analysis::StepPoint> points;
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

TEST_F(RunStepsTest, OfAPositionWhoseUncertaintyIsNotKnownIsAnEstimate) {
  steer(0.1F, 0, 100);
  position_sd_m = std::numeric_limits<float>::quiet_NaN();
  steer(0.1F, 0, 10);
  position_sd_m = 0;
  steer(0.1F, 0, 100);
  const auto steps = measure_steps(points);
  ASSERT_EQ(steps.size(), 1U);
  EXPECT_STREQ(position_source(steps[0]), "estimate");
  EXPECT_TRUE(std::isnan(steps[0].position_sd_m)) << "not the largest of those that are known";
}

TEST_F(RunStepsTest, HoldingNearlyWhereItIsIsNoStepAndSetsNoBand) {
  position_at(0.0996F);
  steer(0.1F, 0, 500);
  steer(0.1F, -0.05F, 500);
  steer(0.1F, -0.0495F, 500);
  const auto steps = measure_steps(points);
  ASSERT_EQ(steps.size(), 1U);
  EXPECT_EQ(steps[0].cause, analysis::StepCause::disturbance);
  EXPECT_NEAR(steps[0].band_m, 0.001, 1e-6) << "2 % of itself, as no setpoint was changed";
  EXPECT_TRUE(steps[0].metrics.settling_s);
}

TEST_F(RunStepsTest, AScanIsAPathNotHundredsOfSteps) {
  steer(0.1F, 0, 500);
  for (int i = 1; i <= 200; ++i) steer(0.1F + 0.01F * static_cast<float>(i), 0, 5);
  steer(2.1F, 0, 500);
  steer(2.1F, -0.05F, 500);
  const auto steps = measure_steps(points);
  ASSERT_EQ(steps.size(), 3U);
  EXPECT_NEAR(steps[0].target_m, 0.1, 1e-6);
  EXPECT_NEAR(steps[1].target_m, 2.1, 1e-6) << "where it is held";
  EXPECT_EQ(steps[2].cause, analysis::StepCause::disturbance);
}

TEST_F(RunStepsTest, MeasuresSetpointsAndDisturbances) {
  rest(50);
  steer(0.1F, 0, 1000);
  steer(0.1F, -0.05F, 1000);
  steer(0.2F, -0.05F, 1000);
  rest(10);
  const auto steps = measure_steps(points);
  ASSERT_EQ(steps.size(), 3U);
  EXPECT_EQ(steps[0].cause, analysis::StepCause::setpoint);
  EXPECT_EQ(steps[0].first_seq, 50U);
  EXPECT_EQ(steps[0].last_seq, 1049U);
  EXPECT_NEAR(steps[0].at_s, 0.5, 1e-9);
  EXPECT_NEAR(*steps[0].metrics.settling_s, 0.38, 1e-9);  // 0.9^38 is the first power of 0.9 below 0.02
  EXPECT_EQ(steps[1].cause, analysis::StepCause::disturbance);
  EXPECT_NEAR(steps[1].start_m, 0.05, 1e-6);
  EXPECT_NEAR(steps[1].band_m, 0.002, 1e-9);
  EXPECT_NEAR(steps[1].metrics.steady_state_error_m, 0, 1e-6);
  EXPECT_EQ(steps[2].cause, analysis::StepCause::setpoint);
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
  points[20].position_m = std::numeric_limits<float>::quiet_NaN();
  const auto steps = measure_steps(points);
  ASSERT_EQ(steps.size(), 2U);
  EXPECT_EQ(steps[0].last_seq, 19U);
  EXPECT_EQ(steps[1].first_seq, 21U);
}

TEST_F(RunStepsTest, NothingSteeredIsNoStep) {
  EXPECT_TRUE(measure_steps(points).empty());
  rest(100);
  steer(0, 0, 100);  // holds where it is
  EXPECT_TRUE(measure_steps(points).empty());
}

// A camera saw the same run: the robot believed in 3 mm too much.
class StepsFromOutside : public RunStepsTest {
 protected:
  StepsFromOutside() {
    position_sd_m = 0.002F;
    rest(100);
    steer(0.1F, 0, 1000);
    steer(0.1F, -0.05F, 1000);
    watch(7'000'000, 7'000'000 + 2100 * 10'000);
  }
  void watch(std::uint64_t from_us, std::uint64_t to_us) {
    reference.positions = {};
    for (std::uint64_t at_us = from_us; at_us < to_us; at_us += 30'000) {
      const analysis::StepPoint& point = points.at((at_us - 7'000'000) / 10'000);
      reference.positions.robot_time_us.push_back(at_us);
      reference.positions.position_m.push_back(static_cast<double>(point.position_m - point.disturbance_m) - 0.003);
      reference.positions.position_sd_m.push_back(0.0002);
    }
  }

  storage::StoredReference reference;
};

TEST_F(StepsFromOutside, AreMeasuredByTheTruePositionAndSayHowWrongTheRobotWas) {
  const auto steps = measure_steps(points, &reference);
  ASSERT_EQ(steps.size(), 2U);
  for (const analysis::MeasuredStep& step : steps) {
    EXPECT_TRUE(step.is_from_outside);
    EXPECT_NEAR(step.position_sd_m, 0.0002, 1e-9);
    EXPECT_NEAR(step.metrics.steady_state_error_m, 0.003, 1e-4);
    EXPECT_FALSE(step.metrics.settling_s);  // it stays 3 mm off, and the band is 2 mm
    ASSERT_TRUE(step.estimate_error);
    EXPECT_NEAR(step.estimate_error->rms_m, 0.003, 4e-4);
    EXPECT_GE(step.estimate_error->worst_m, 0.003 - 1e-6);
    EXPECT_GT(step.estimate_error->within_2_sd, 0.95);  // ± 4 mm
    EXPECT_GT(step.estimate_error->samples, 290U);
  }
  EXPECT_NEAR(steps[0].start_m, -0.003, 1e-6);
  EXPECT_NEAR(steps[1].start_m, 0.1 - 0.05 - 0.003, 1e-4);
  const auto whole = estimate_error(points, reference);
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->samples, reference.positions.size());
  for (analysis::StepPoint& point : points) point.position_sd_m = 0.0005F;
  EXPECT_LT(estimate_error(points, reference)->within_2_sd, 0.05);  // now it claims ± 1 mm
}

TEST_F(StepsFromOutside, SettlingIsTheTruePositionsOwn) {
  for (double& position_m : reference.positions.position_m) position_m += 0.003;
  const auto steps = measure_steps(points, &reference);
  EXPECT_NEAR(*steps[0].metrics.settling_s, 0.38, 0.1);
  EXPECT_NEAR(steps[0].metrics.steady_state_error_m, 0, 1e-4);
}

TEST_F(StepsFromOutside, AStepThatBeginsInMotionStartsWhereTheRobotIsThen) {
  points.clear();
  next_seq = 0;
  constexpr double kVelocityM_S = 0.1, kStepAtS = 3.005;  // between two positions of the camera
  const auto true_m = [=](double at_s) {
    const double after_s = std::max(0.0, at_s - kStepAtS);
    return -0.2 + kVelocityM_S * std::min(at_s, kStepAtS) + 0.1 * (1 - std::exp(-after_s / 0.3));
  };
  for (int k = 0; k < 1000; ++k) {
    const double at_s = 0.01 * k;
    points.push_back({0, next_seq++, 7'000'000 + static_cast<std::uint64_t>(k) * 10'000,
                      static_cast<float>(true_m(at_s)), 0, at_s < kStepAtS ? 0.3F : 0.2005F, true, position_sd_m});
  }
  reference.positions = {};
  for (double at_s = 0.004; at_s < 9.9; at_s += 1.0 / 30) {
    reference.positions.robot_time_us.push_back(7'000'000 + static_cast<std::uint64_t>(1e6 * at_s));
    reference.positions.position_m.push_back(true_m(at_s));
    reference.positions.position_sd_m.push_back(0.0002);
  }
  const auto steps = measure_steps(points, &reference);
  ASSERT_EQ(steps.size(), 2U);
  ASSERT_TRUE(steps[1].is_from_outside);
  EXPECT_NEAR(steps[1].start_m, true_m(3.01), 0.002) << "the mean of the 200 ms before is 10 mm behind";
  EXPECT_NEAR(steps[1].position_sd_m, 0.0002, 0.0001);
  auto& times = reference.positions.robot_time_us;
  std::size_t kept = 0;  // a slower camera: 5 positions a second
  for (std::size_t i = 2; i < times.size(); i += 6, ++kept) {
    times[kept] = times[i];
    reference.positions.position_m[kept] = reference.positions.position_m[i];
  }
  times.resize(kept);
  reference.positions.position_m.resize(kept);
  reference.positions.position_sd_m.resize(kept);
  EXPECT_NEAR(measure_steps(points, &reference)[1].start_m, true_m(3.01), 0.01);
}

TEST_F(StepsFromOutside, AStartAmongPositionsThatScatterIsAsUncertainAsThey) {
  for (std::size_t i = 0; i < reference.positions.size(); i += 2) reference.positions.position_m[i] += 0.004;
  const auto steps = measure_steps(points, &reference);
  EXPECT_GT(steps[0].position_sd_m, 0.001) << "said to be exact to 0.2 mm";
}

TEST_F(StepsFromOutside, TheUncertaintyOfTheZeroCounts) {
  reference.reference.zero_sd_m = 0.0015;
  const auto steps = measure_steps(points, &reference);
  EXPECT_FALSE(steps.empty());
  for (const analysis::MeasuredStep& step : steps) {
    EXPECT_NEAR(step.position_sd_m, std::hypot(0.0002, 0.0015), 1e-9);
  }
}

TEST_F(StepsFromOutside, AStepThatWasNotSeenThroughoutStaysAnEstimate) {
  watch(7'000'000 + 500 * 10'000, 7'000'000 + 2100 * 10'000);
  auto steps = measure_steps(points, &reference);
  EXPECT_FALSE(steps[0].is_from_outside);
  EXPECT_FALSE(steps[0].estimate_error);
  EXPECT_NEAR(steps[0].position_sd_m, 0.002, 1e-6);
  EXPECT_TRUE(steps[1].is_from_outside);
  reference.reference.span = 1;
  EXPECT_FALSE(measure_steps(points, &reference)[1].is_from_outside);
  EXPECT_FALSE(estimate_error(points, reference));
  reference.reference.span = 0;
  auto& times = reference.positions.robot_time_us;
  for (std::size_t i = 400; i < times.size(); ++i) times[i] += 300'000;  // a pause
  EXPECT_FALSE(measure_steps(points, &reference)[1].is_from_outside);
}

}  // namespace
}  // namespace server
