// The estimator's rules, one by one; what it is worth in numbers is in estimator_study_test.cpp.
#include "robot_fw/core/estimator.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include "control/models/modal_plant.hpp"

namespace robot_fw {
namespace {

constexpr float kEstimatorTickS = 0.01F;

// Ticks of an estimator whose accelerometer has neither noise nor bias.
class EstimatorTest : public ::testing::Test {
 protected:
  void tick(float duty, int counts, bool is_valid = true) {
    estimator.step({static_cast<std::int16_t>(counts), is_valid, duty, kEstimatorTickS});
  }
  void rest(double seconds) {
    for (int k = 0; k < std::lround(seconds * 100); ++k) tick(0, noise(random));
  }
  void drive_unsensed(float duty, double seconds) {
    for (int k = 0; k < std::lround(seconds * 100); ++k) tick(duty, 0, false);
  }

  std::minstd_rand random{1};
  std::uniform_int_distribution<> noise{-2, 2};  // counts; mean 0
  Estimator estimator{EstimatorParameters{}};
};

void expect_to_follow(const VelocityModel& model, const control::FractionalModel& truth, float tolerance) {
  EstimatorParameters parameters;
  parameters.model = model;
  Estimator estimator{parameters};
  control::ModalPlant plant{truth, static_cast<double>(kEstimatorTickS)};
  for (int k = 0; k < 6000; ++k) {
    const float duty = k % 200 < 100 ? 1.0F : -0.5F;
    plant.step(static_cast<double>(duty));
    estimator.step({0, false, duty, kEstimatorTickS});
    ASSERT_NEAR(estimator.velocity_m_s(), plant.velocity_m_s(), tolerance) << "tick " << k;
  }
}

TEST_F(EstimatorTest, WithoutReadingsFollowsTheFluidsModel) {
  expect_to_follow(kFluidVelocityModel, control::kNonNewtonianModel, 0.001F);
}

TEST_F(EstimatorTest, WithoutReadingsFollowsTheWatersModel) {
  expect_to_follow(kWaterVelocityModel, control::kNewtonianModel, 0.001F);
}

TEST_F(EstimatorTest, WithoutReadingsIsAsUnsureAsTheModelsGain) {
  drive_unsensed(1, 10);
  EXPECT_NEAR(estimator.position_m(), 1, 0.02F);
  EXPECT_GT(estimator.position_sd_m(), 0.15F);
  EXPECT_LT(estimator.position_sd_m(), 0.3F);
}

TEST_F(EstimatorTest, AtRestStaysWhereItIsAndFindsTheBias) {
  constexpr int kBiasCounts = 3;
  for (int k = 0; k < 3000; ++k) tick(0, kBiasCounts + noise(random));
  EXPECT_NEAR(estimator.bias_m_s2(), 0.03F, 0.003F);
  EXPECT_NEAR(estimator.velocity_m_s(), 0, 0.0005F);
  EXPECT_LT(std::fabs(estimator.position_m()), 2 * estimator.position_sd_m());
  EXPECT_FALSE(estimator.model_mismatch());
}

TEST_F(EstimatorTest, IsSurerAtRestWithTheMotorOffThanWithTheMotorOn) {
  Estimator driven{EstimatorParameters{}};
  for (int k = 0; k < 3000; ++k) {
    const int counts = noise(random);
    tick(0, counts);
    driven.step({static_cast<std::int16_t>(counts), true, 1e-6F, kEstimatorTickS});
  }
  EXPECT_LT(2 * estimator.position_sd_m(), driven.position_sd_m());
}

TEST_F(EstimatorTest, CountsTheWayUnderADoubtfulDutyAsUnsure) {
  for (int k = 0; k < 1000; ++k) tick(0.04F, noise(random));  // it stands still
  EXPECT_LT(estimator.position_m(), 2 * estimator.position_sd_m());
}

TEST_F(EstimatorTest, TakesADutyInTheDeadZoneAsZero) {
  EstimatorParameters parameters;
  parameters.dead_zone_duty = 0.05F;
  Estimator stepped{parameters};
  for (int k = 0; k < 500; ++k) stepped.step({0, false, 0.04F, kEstimatorTickS});
  EXPECT_EQ(stepped.position_m(), 0);
}

TEST_F(EstimatorTest, TakesReadingsThatNeverChangeAsMissing) {
  for (int k = 0; k < 1000; ++k) tick(0, 40);  // 0.4 m/s² would be 20 m
  EXPECT_LT(std::fabs(estimator.position_m()), 0.5F);
}

TEST_F(EstimatorTest, SeesAPulsatingFlowAndIsUnsureOfTheMeanFlow) {
  for (int k = 0; k < 1000; ++k) tick(0, static_cast<int>(std::lround(60 * std::cos(0.0733 * k))));
  EXPECT_NEAR(estimator.flow_m_s(), 0.058F, 0.02F);  // 0.6/7.33/√2
  EXPECT_GT(estimator.position_sd_m(), 0.3F);
  rest(10);
  EXPECT_EQ(estimator.flow_m_s(), 0);
}

TEST_F(EstimatorTest, SaysAMismatchWhenTheMotorDoesNotMoveIt) {
  for (int k = 0; k < 200; ++k) tick(1, noise(random));
  EXPECT_TRUE(estimator.model_mismatch());
  EXPECT_LT(estimator.model_gain(), 0.2F);
}

TEST_F(EstimatorTest, ZeroPositionIsExactAndKeepsWhatIsKnownOfTheRest) {
  drive_unsensed(0.5F, 2);
  const float velocity_m_s = estimator.velocity_m_s();
  estimator.zero_position();
  EXPECT_EQ(estimator.position_m(), 0);
  EXPECT_EQ(estimator.position_sd_m(), 0);
  EXPECT_EQ(estimator.velocity_m_s(), velocity_m_s);
}

TEST_F(EstimatorTest, PassesOverTicksOfNoLength) {
  rest(1);
  const float position_m = estimator.position_m();
  for (const float dt_s : {0.0F, -1.0F, 1.0F, std::numeric_limits<float>::quiet_NaN()}) {
    estimator.step({1000, true, 1, dt_s});
  }
  EXPECT_EQ(estimator.position_m(), position_m);
}

TEST_F(EstimatorTest, StaysFiniteWhateverComesIn) {
  std::uniform_int_distribution<> counts{-32768, 32767}, kind{0, 9};
  std::uniform_real_distribution<float> duty{-3, 3}, dt_s{0.0001F, 0.1F};
  for (int k = 0; k < 100'000; ++k) {
    const int what = kind(random);
    const bool wild = k / 10'000 % 2 == 0;
    const float wanted = what == 0 ? std::numeric_limits<float>::infinity() : duty(random);
    estimator.step({static_cast<std::int16_t>(wild ? counts(random) : noise(random)), what != 1, wanted,
                    what == 2 ? dt_s(random) : kEstimatorTickS});
    ASSERT_TRUE(std::isfinite(estimator.position_m()) && std::isfinite(estimator.velocity_m_s())) << "tick " << k;
    ASSERT_TRUE(std::isfinite(estimator.position_sd_m()) && estimator.position_sd_m() >= 0) << "tick " << k;
  }
}

TEST_F(EstimatorTest, StartsAnewAndUnsureWhenItsParametersAreNotFinite) {
  EstimatorParameters parameters;
  parameters.noise_m_s2 = std::numeric_limits<float>::quiet_NaN();
  Estimator broken{parameters};
  for (int k = 0; k < 100; ++k) broken.step({static_cast<std::int16_t>(noise(random)), true, 0, kEstimatorTickS});
  EXPECT_NEAR(broken.position_m(), 0, 0.001F);
  EXPECT_EQ(broken.position_sd_m(), 10);
}

// SAFETY: stillness that was felt before the motor ran says nothing of what follows, also when no readings come.
TEST_F(EstimatorTest, IsNotSettledByAStillnessFromBeforeTheMotorRan) {
  rest(6);
  drive_unsensed(1, 2);
  drive_unsensed(0, 0.01);
  EXPECT_FALSE(estimator.at_rest());
  EXPECT_FALSE(estimator.is_settled());
}

struct Sds {
  float least_m = std::numeric_limits<float>::infinity();
  float greatest_m = 0;
};

// Of a minute in which the motor is on, for 2 s of every 4 s or all the time, and nothing is felt but noise.
Sds sds_in_a_minute(const EstimatorParameters& parameters, bool held) {
  std::minstd_rand random{1};
  std::uniform_int_distribution<> noise{-2, 2};
  Estimator estimator{parameters};
  Sds sds;
  for (int k = 0; k < 6000; ++k) {
    const float duty = held || k / 200 % 2 == 0 ? 0.6F : 0;
    estimator.step({static_cast<std::int16_t>(noise(random)), true, duty, kEstimatorTickS});
    if (k < 100) continue;
    sds.least_m = std::min(sds.least_m, estimator.position_sd_m());
    sds.greatest_m = std::max(sds.greatest_m, estimator.position_sd_m());
  }
  return sds;
}

// SAFETY: of gains that all but cancel, rounding leaves no covariance; the filter must not be certain because of that.
TEST_F(EstimatorTest, IsNeverCertainBecauseTheGainsOfItsModelCancel) {
  for (const float gain_m_s : {3.0F, 10.0F}) {
    for (const float gain_error : {0.2F, 0.3F, 1.0F}) {
      for (const bool held : {false, true}) {
        EstimatorParameters parameters{.is_confirmed = true, .gain_error = gain_error};
        parameters.model = {{gain_m_s, 0.1F - gain_m_s, 0.1F - gain_m_s, gain_m_s - 0.1F},
                            {0.05F, 0.052F, 0.7F, 0.75F}};
        EXPECT_GT(sds_in_a_minute(parameters, held).least_m, 0.0003F) << gain_m_s << ", " << gain_error << ", " << held;
      }
    }
  }
}

// SAFETY: who starts anew in motion does not take it for rest, nor the model for one that moves nothing.
TEST_F(EstimatorTest, FindsItsVelocityWhenItStartsAnewInMotion) {
  EstimatorParameters parameters{.is_confirmed = true, .shape_error = 0.03F};
  parameters.model = {{10, -9.9F, -9.9F, 9.9F}, {0.05F, 0.052F, 0.7F, 0.75F}};
  Estimator driven{parameters};
  std::array<float, kModelSections> section{};
  float true_m_s = 0;
  const auto tick = [&](float duty) {
    const float before_m_s = std::exchange(true_m_s, 0);
    for (std::size_t i = 0; i < kModelSections; ++i) {
      section[i] += (1 - std::exp(-kEstimatorTickS / parameters.model.time_constant_s[i])) * (duty - section[i]);
      true_m_s += parameters.model.gain_m_s[i] * section[i];
    }
    const float counts = 100 * (true_m_s - before_m_s) / kEstimatorTickS;
    driven.step({static_cast<std::int16_t>(std::lround(counts) + noise(random)), true, duty, kEstimatorTickS});
  };
  int ticks = 0;
  for (; driven.position_sd_m() < 1 && ticks < 6000; ++ticks) tick(ticks / 200 % 2 == 0 ? 0.6F : 0);
  ASSERT_EQ(driven.velocity_m_s(), 0) << "it has started anew";
  ASSERT_GT(std::fabs(true_m_s), 0.01F);
  for (int k = 0; k < 5; ++k) tick(0.6F);
  EXPECT_NEAR(driven.velocity_m_s(), true_m_s, 0.001F);
}

TEST_F(EstimatorTest, NeverStartsAnewWithTheModelsOfWaterAndFluid) {
  for (const VelocityModel& model : {kFluidVelocityModel, kWaterVelocityModel}) {
    for (const bool is_confirmed : {false, true}) {
      for (const float gain_error : {0.2F, 1.0F}) {
        const EstimatorParameters parameters{.model = model, .is_confirmed = is_confirmed, .gain_error = gain_error};
        EXPECT_LT(sds_in_a_minute(parameters, false).greatest_m, 1.0F);
        EXPECT_LT(sds_in_a_minute(parameters, true).greatest_m, 1.0F);
      }
    }
  }
}

TEST_F(EstimatorTest, IsSmall) { EXPECT_LE(sizeof(Estimator), 600u); }

}  // namespace
}  // namespace robot_fw
