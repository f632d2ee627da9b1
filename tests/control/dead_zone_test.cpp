// A motor that stands still below some duty is named, and the fluid's parameters come out as without it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "control/identification/identifiability.hpp"
#include "control/identification/identify.hpp"
#include "recorded_runs.hpp"

namespace control {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::Gt;
using testing::HasSubstr;
using testing::Le;
using testing::Not;
using testing::StartsWith;

constexpr double kPushTickS = 0.01;
constexpr FractionalModel kFluidOfMotor{0.1, 0.0045, 0.15, 1, 1.75, 0.85};
const auto kStandsStill = StartsWith("the motor stands still below a duty between ");

// Pushes of these duties, both ways, with rests: half a second each.
std::vector<double> pushes(const std::vector<double>& duties) {
  std::vector<double> all(100, 0);
  for (int round = 0; round < 3; ++round) {
    for (const double duty : duties) {
      for (const double part : {duty, 0.0, -duty, 0.0}) all.insert(all.end(), 50, part);
    }
  }
  return all;
}

std::vector<double> made_by_motor(std::vector<double> duty, double dead_zone) {
  for (double& value : duty) value = std::abs(value) < dead_zone ? 0 : value;
  return duty;
}

Recording accelerations(const std::vector<double>& duty, double dead_zone, unsigned seed) {
  Recording run{kPushTickS, duty, {}, {}};
  run.acceleration_m_s2 = output_of(kFluidOfMotor, Channel::acceleration, kPushTickS, made_by_motor(duty, dead_zone));
  add_noise(run.acceleration_m_s2, 0.012, seed);
  return run;
}

IdentificationOptions one_start_only() {
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::fractional;
  options.further_starts = 0;
  return options;
}

const std::vector<double> kPushed{0.03, 0.06, 0.1, 0.15, 0.2, 0.3};

TEST(DeadZone, IsNamedBetweenTheDutiesThatWereTried) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    const Identification found = identify(accelerations(pushes(kPushed), 0.08, seed), one_start_only());
    ASSERT_TRUE(found.dead_zone) << seed;
    EXPECT_EQ(found.dead_zone->from_duty, 0.06);
    EXPECT_EQ(found.dead_zone->to_duty, 0.1);
    EXPECT_THAT(found.warnings,
                Contains(AllOf(kStandsStill, HasSubstr("dead_zone_duty to 0.06 and doubtful_duty to 0.1"))));
    const auto doubt = std::ranges::find(found.doubts, DoubtCode::dead_zone, &Doubt::code);
    ASSERT_NE(doubt, found.doubts.end());
    EXPECT_EQ(doubt->value, 0.06);
    EXPECT_TRUE(is_grave(*doubt)) << "for a robot that does not know of it";
    EXPECT_EQ(doubt->widening, 1);
  }
}

// The parameters are those of the fluid, as the same record of a motor without a dead zone gives them.
TEST(DeadZone, TheFluidComesOutAsWithoutIt) {
  const auto found_behind = [](double dead_zone) {
    Recording run{kPushTickS, pushes(kPushed), {}, {}};
    run.position_m = output_of(kFluidOfMotor, Channel::position, kPushTickS, made_by_motor(run.duty, dead_zone));
    add_noise(run.position_m, 2e-4, 3);
    return identify(run, one_start_only());
  };
  const Identification found = found_behind(0.08), without = found_behind(0);
  ASSERT_TRUE(found.dead_zone);
  EXPECT_FALSE(without.dead_zone);
  const auto parameters = parameters_of(found.best.model), expected = parameters_of(without.best.model);
  for (std::size_t i = 0; i < kParameters; ++i) {
    EXPECT_NEAR(parameters[i], expected[i], 3 * *found.best.one_sigma[i]) << kParameterNames[i];
  }
  EXPECT_FALSE(changes_with_amplitude(found.amplitude));
}

TEST(DeadZone, OfAChirpIsNamedOnAGrid) {
  std::vector<double> duty;
  for (int k = 0; k < 4000; ++k) duty.push_back(0.2 * std::sin(1e-5 * k * k + 0.01 * k));
  const Identification found = identify(accelerations(duty, 0.08, 3), one_start_only());
  ASSERT_TRUE(found.dead_zone);
  EXPECT_THAT(found.dead_zone->from_duty, AllOf(Gt(0.06), Le(0.1)));
}

TEST(DeadZone, IsNotSeenInAMotorWithoutOne) {
  for (const unsigned seed : {1U, 2U, 3U, 4U, 5U}) {
    const Identification found = identify(accelerations(pushes(kPushed), 0, seed), one_start_only());
    EXPECT_FALSE(found.dead_zone) << seed;
    EXPECT_THAT(found.warnings, Not(Contains(kStandsStill)));
  }
}

// A duty of one magnitude does not show it, and needs not: the robot was never driven below.
TEST(DeadZone, IsNotAskedForWhereEachDutyMovesTheRobot) {
  const Identification found = identify(accelerations(prbs_duty(0.6, 0.4, 20, kPushTickS), 0.08, 1), one_start_only());
  EXPECT_FALSE(found.dead_zone);
}

// Levels of both signs for half a second each, never 0.
std::vector<double> levels_without_rest(const std::vector<double>& levels, int bits, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<double> all;
  for (int bit = 0; bit < bits; ++bit) {
    const double level = levels[random() % levels.size()];
    all.insert(all.end(), 50, random() % 2 == 0 ? level : -level);
  }
  return all;
}

// The robot is at rest at the smallest duty, which is not 0.
TEST(DeadZone, IsNamedAboveTheSmallestDutyOfARecordThatIsNeverAtRest) {
  const std::vector<double> duty = levels_without_rest({0.06, 0.15, 0.3}, 40, 5);
  for (const unsigned seed : {1U, 2U, 3U}) {
    const Identification found = identify(accelerations(duty, 0.1, seed), one_start_only());
    ASSERT_TRUE(found.dead_zone) << seed;
    EXPECT_EQ(found.dead_zone->from_duty, 0.06);
    EXPECT_EQ(found.dead_zone->to_duty, 0.15);
    EXPECT_FALSE(identify(accelerations(duty, 0, seed), one_start_only()).dead_zone) << seed;
  }
}

Recording positions(const std::vector<double>& duty, double dead_zone, unsigned seed) {
  Recording run{kPushTickS, duty, {}, {}};
  run.position_m = output_of(kFluidOfMotor, Channel::position, kPushTickS, made_by_motor(duty, dead_zone));
  add_noise(run.position_m, 2e-4, seed);
  return run;
}

TEST(DeadZone, OfSeveralRunsIsNamedOnceAndTheFluidComesOutAsWithoutIt) {
  for (const auto& make : {accelerations, positions}) {
    const auto together = [&make](double dead_zone) {
      const std::vector<Recording> runs{make(pushes(kPushed), dead_zone, 1), make(pushes(kPushed), dead_zone, 2)};
      return identify_together(runs, one_start_only());
    };
    const Identification found = together(0.08), without = together(0);
    ASSERT_TRUE(found.dead_zone);
    EXPECT_FALSE(without.dead_zone);
    EXPECT_EQ(found.dead_zone->from_duty, 0.06);
    EXPECT_EQ(found.dead_zone->to_duty, 0.1);
    EXPECT_THAT(found.warnings, Contains(kStandsStill).Times(1));
    EXPECT_EQ(std::ranges::count(found.doubts, DoubtCode::dead_zone, &Doubt::code), 1);
    ASSERT_EQ(found.runs.size(), 2U);
    const auto parameters = parameters_of(found.best.model), expected = parameters_of(without.best.model);
    for (std::size_t i = 0; i < kParameters; ++i) {
      EXPECT_NEAR(parameters[i], expected[i], 3 * *found.best.one_sigma[i]) << kParameterNames[i];
    }
  }
}

// A drag that grows with the speed is no dead zone.
TEST(DeadZone, IsNoDragThatFollowsTheSpeed) {
  Recording run{kPushTickS, pushes(kPushed), {}, {}};
  std::vector<double> drag = output_of(kFluidOfMotor, Channel::velocity, kPushTickS, run.duty);
  for (double& velocity : drag) velocity *= 30 * std::abs(velocity);
  run.velocity_m_s = output_of(kFluidOfMotor, Channel::velocity, kPushTickS, run.duty);
  const std::vector<double> slower = output_of(kFluidOfMotor, Channel::velocity, kPushTickS, drag);
  for (std::size_t k = 0; k < slower.size(); ++k) run.velocity_m_s[k] -= slower[k];
  add_noise(run.velocity_m_s, 1e-5, 3);
  EXPECT_FALSE(identify(run, one_start_only()).dead_zone);
}

}  // namespace
}  // namespace control
