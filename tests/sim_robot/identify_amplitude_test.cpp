// Identification says when the parameters change with amplitude, and does not say it of linear fluids.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/sim_robot/identification_trial.hpp"

namespace sim_robot {
namespace {

constexpr double kPositionSdM = 0.0005;
constexpr std::uint64_t kSeed = 7;

control::Identification identified(const control::Recording& recording) {
  return control::identify(recording, one_start_options());
}

bool doubts_amplitude(const control::Identification& found) {
  return std::ranges::any_of(found.warnings, [](const std::string& warning) {
    return warning.starts_with("the parameters change with amplitude: ");
  });
}

std::vector<double> twenty_seconds_of_levels() {
  std::vector<double> duty = levels_duty(kSeed);
  duty.resize(2000);
  return duty;
}

// Of a robot's acceleration, and of a position measured from outside.
std::vector<control::Identification> both_ways(const IdentificationTrial& trial) {
  return {identified(record(trial, kSeed)), identified(record_position(trial, kPositionSdM, kSeed))};
}

IdentificationTrial thinning(std::vector<double> duty) {
  return {.fluid = {}, .duty = std::move(duty), .kind = PlantKind::shear_thinning};
}

TEST(IdentifyAmplitude, StepsOfThreeSizesShowAFluidThatThins) {
  for (const auto& found : both_ways(thinning(steps_duty()))) {
    EXPECT_TRUE(doubts_amplitude(found));
    ASSERT_TRUE(found.amplitude);
    EXPECT_GT(found.amplitude->f, 200);
    EXPECT_GT(found.amplitude->share, 0.4);
  }
}

TEST(IdentifyAmplitude, ADutyOfManyLevelsShowsAFluidThatThins) {
  for (const auto& found : both_ways(thinning(twenty_seconds_of_levels()))) EXPECT_TRUE(doubts_amplitude(found));
}

// There the duty has one size: the speed tells it.
TEST(IdentifyAmplitude, ABinarySequenceShowsItToTheAccelerometer) {
  EXPECT_TRUE(doubts_amplitude(identified(record(thinning(study_duty()), kSeed))));
}

TEST(IdentifyAmplitude, ALinearFluidIsNotDoubted) {
  for (const auto& duty : {steps_duty(), twenty_seconds_of_levels()}) {
    for (const auto& found : both_ways({.fluid = kStudyFluids[0], .duty = duty})) {
      EXPECT_FALSE(doubts_amplitude(found));
      ASSERT_TRUE(found.amplitude);
      EXPECT_LT(found.amplitude->share, 0.1);
      EXPECT_LT(found.amplitude->f, 50);
    }
  }
}

// It leaves residuals that are not white, and those have nothing to do with the amplitude.
TEST(IdentifyAmplitude, ADeadTimeThatIsNotFittedIsAnotherDoubt) {
  const IdentificationTrial trial{
      .fluid = control::kNonNewtonianModel, .duty = twenty_seconds_of_levels(), .dead_time_s = 0.07};
  for (const auto& found : both_ways(trial)) {
    EXPECT_FALSE(doubts_amplitude(found));
    const bool is_at_limit = found.best.sensor && found.best.sensor->delay_is_at_limit;  // of what the age may be
    EXPECT_EQ(found.amplitude.has_value(), !is_at_limit);
  }
  const auto nearly_without_noise = identified(record_position(trial, 1e-6, kSeed));
  EXPECT_FALSE(nearly_without_noise.best.residuals_are_white);
  EXPECT_FALSE(doubts_amplitude(nearly_without_noise));
}

// A duty of one size does not show that it thins, but its residuals follow the duty.
TEST(IdentifyAmplitude, AFluidThatThinsHasNoDeadTimeButItsOwn) {
  control::IdentificationOptions options = one_start_options();
  options.tries_dead_time = true;
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U, 6U}) {
    IdentificationTrial trial = thinning(study_duty());
    const auto prompt = control::identify(record_position(trial, kPositionSdM, seed), options);
    EXPECT_EQ(prompt.best.model.dead_time_s, 0) << seed;
    trial.dead_time_s = 0.04;
    const auto late = control::identify(record_position(trial, kPositionSdM, seed), options);
    EXPECT_NEAR(late.best.model.dead_time_s, 0.04, 0.015) << seed;
  }
}

// Few and far between, steps do not tell the sensor's clock: each has readings of the age that it happens to have.
TEST(IdentifyAmplitude, AnotherAgeOfTheReadingsInEachStepIsNoAmplitude) {
  constexpr std::uint64_t kUnluckySeed = 119;
  const auto found = identified(record({.fluid = kStudyFluids[3], .duty = steps_duty()}, kUnluckySeed));
  ASSERT_TRUE(found.best.sensor);
  EXPECT_FALSE(found.best.sensor->has_own_clock);
  EXPECT_FALSE(doubts_amplitude(found));
}

TEST(IdentifyAmplitude, ResidualsOfRoundingAreNotLookedAt) {
  const auto found = identified(record_position({.fluid = kStudyFluids[0], .duty = steps_duty()}, 0, kSeed));
  EXPECT_FALSE(found.amplitude);
  EXPECT_FALSE(doubts_amplitude(found));
}

}  // namespace
}  // namespace sim_robot
