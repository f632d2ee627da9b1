// What a run commands, tick by tick.
#include "server/experiments/time_line.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/server/experiments/steps.hpp"

namespace server::experiments {
namespace {

using ::testing::ElementsAre;

TEST(TimeLine, StepsFollowEachOtherWithTheFactorsOfTheRun) {
  Profile profile;
  Step disturbance = step_of(StepKind::disturbance, 4);
  disturbance.disturbance_m = -0.05;
  profile.steps = {duty_step(0.4, 2), setpoint_step(0.1, 3), disturbance};
  const TimeLine line = time_line_of(profile, {.duty_factor = 0.5, .setpoint_factor = 2});
  EXPECT_THAT(line.actions, ElementsAre(Action{0, ActionKind::duty, 0.2, 0}, Action{200, ActionKind::setpoint, 0.2, 1},
                                        Action{500, ActionKind::disturbance, -0.1, 2}));
  EXPECT_THAT(line.step_begins, ElementsAre(0, 200, 500));
  EXPECT_EQ(line.ticks, 900U);
  EXPECT_DOUBLE_EQ(line.duration_s(), 9);
}

// SAFETY: the motor is off after the last duty.
TEST(TimeLine, EndsWithDuty0InManual) {
  Profile profile;
  profile.steps = {duty_step(0.4, 2)};
  const TimeLine line = time_line_of(profile, {});
  EXPECT_EQ(line.actions.back(), (Action{200, ActionKind::duty, 0, 0}));
  EXPECT_EQ(line.ticks, 200U);
}

TEST(TimeLine, AScanMovesTheSetpointAtItsVelocityAndEndsThere) {
  Profile profile;
  Step scan = step_of(StepKind::scan, 1);
  scan.setpoint_m = 0.05;
  scan.velocity_m_s = 0.1;
  scan.every_s = 0.2;
  profile.steps = {setpoint_step(0.1, 1), scan};
  const TimeLine line = time_line_of(profile, {});
  ASSERT_EQ(line.actions.size(), 4U);
  EXPECT_EQ(line.actions[1].tick, 100U);
  EXPECT_NEAR(line.actions[1].value, 0.08, 1e-12);
  EXPECT_EQ(line.actions[2].tick, 120U);
  EXPECT_NEAR(line.actions[2].value, 0.06, 1e-12);
  EXPECT_EQ(line.actions[3].value, 0.05) << "the last part is shorter";
  EXPECT_EQ(line.ticks, 100U + 50U + 100U);
  EXPECT_DOUBLE_EQ(longest_duration_s(profile), line.duration_s());
}

TEST(TimeLine, TonesAreThreeSinesOfTheSetpointThatEndAtTheirMean) {
  Profile profile;
  Step tones = step_of(StepKind::tones, 70);
  tones.setpoint_m = 0.05;
  tones.amplitude_m = 0.02;
  tones.crossover_rad_s = 4;
  profile.steps = {tones};
  const TimeLine line = time_line_of(profile, {.setpoint_factor = 2});
  const auto& first = line.actions.at(1);  // behind that of the change of mode
  EXPECT_EQ(first.tick, kModeChangeTicks);
  EXPECT_NEAR(first.value, 2 * (0.05 + 0.02 * (std::sin(2.0) + std::sin(4.0))), 1e-12);
  double lowest_m = 1, highest_m = -1;
  for (const Action& action : line.actions) {
    lowest_m = std::min(lowest_m, action.value);
    highest_m = std::max(highest_m, action.value);
  }
  EXPECT_GE(lowest_m, 2 * (0.05 - 0.06));
  EXPECT_LE(highest_m, 2 * (0.05 + 0.06));
  EXPECT_GT(highest_m - lowest_m, 0.15) << "they add up now and then";
  EXPECT_DOUBLE_EQ(line.actions.back().value, 0.1);
  EXPECT_LT(line.actions.back().tick, line.ticks);
}

TEST(TimeLine, TheLongestDurationIsThatOfTheLargestFactor) {
  Profile profile;
  Step scan = step_of(StepKind::scan, 0);
  scan.setpoint_m = 0.5;
  scan.velocity_m_s = 0.1;
  profile.steps = {scan};
  profile.sweep.setpoint_factor = {1, -2};
  EXPECT_DOUBLE_EQ(longest_duration_s(profile), 10.5) << "0.5 s of them at the beginning of the scan";
  EXPECT_DOUBLE_EQ(time_line_of(profile, variants_of(profile)[1]).duration_s(), 10.5);
}

}  // namespace
}  // namespace server::experiments
