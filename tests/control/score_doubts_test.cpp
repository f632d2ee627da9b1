// Residuals that are put down to amplitude: a drag behind a dead time is, an order that was forced is not.
// And what to another linear model, as a dead time is, which is then looked for.
#include "control/evidence/score_doubts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "control/identification/second_opinions.hpp"
#include "recorded_runs.hpp"

namespace control {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr double kStepS = 0.01;
constexpr FractionalModel kTestedFluid{0.1, 0.0045, 0.15, 1, 1.75, 0.85};

// The velocity of a fluid with a little drag that grows with the square of the speed, to the first order in it.
Recording dragged_run(double dead_time_s) {
  constexpr double kDrag = 30, kNoiseM_S = 1e-6;
  Recording run{kStepS, prbs_duty(0.6, 0.4, 20, kStepS), {}, {}};
  std::vector<double> drag = output_of(kTestedFluid, Channel::velocity, kStepS, run.duty);
  for (double& velocity : drag) velocity *= kDrag * std::abs(velocity);
  run.velocity_m_s = output_of(kTestedFluid, Channel::velocity, kStepS, run.duty, dead_time_s);
  const std::vector<double> slower = output_of(kTestedFluid, Channel::velocity, kStepS, drag, dead_time_s);
  for (std::size_t k = 0; k < slower.size(); ++k) run.velocity_m_s[k] -= slower[k];
  add_noise(run.velocity_m_s, kNoiseM_S, 3);
  return run;
}

// Evidence about the true fluid, as if it had been found.
ScoreEvidence evidence_of(const Recording& run, double dead_time_s) {
  IdentificationOptions options = unhurried_options();
  options.longest_dead_time_s = 1;
  OutputErrorSearch search(run, options);
  SearchPoint point{kTestedFluid};
  point.model.dead_time_s = dead_time_s;
  Fit fit;
  fit.model = point.model;
  return amplitude_evidence(search, run, fit, point).value();
}

TEST(AmplitudeDoubt, ADragThatFollowsTheSpeedIsSeenBehindADeadTime) {
  const ScoreEvidence prompt = evidence_of(dragged_run(0), 0), late = evidence_of(dragged_run(0.3), 0.3);
  EXPECT_GT(prompt.share, 0.99);
  EXPECT_GT(late.share, 0.99);
}

TEST(AmplitudeDoubt, ItIsGraveByWhatItExplains) {
  IdentificationOptions options = unhurried_options();
  options.further_starts = 0;
  const Identification found = identify(dragged_run(0), options);
  const auto doubt = std::ranges::find(found.doubts, DoubtCode::no_linear_model_over_amplitude, &Doubt::code);
  ASSERT_NE(doubt, found.doubts.end());
  EXPECT_EQ(doubt->value, found.amplitude->share);
  const double values_per_parameter = 2000.0 / found.best.free_parameters;
  EXPECT_NEAR(*doubt->widening, std::sqrt(1 + *doubt->value * values_per_parameter), 0.1);
  EXPECT_TRUE(is_grave(*doubt));
}

// A fluid of four terms whose acceleration is fitted by two.
TEST(AmplitudeDoubt, AnOrderThatWasForcedIsNamedAsTheLikelierReason) {
  Recording run{kStepS, prbs_duty(0.6, 0.5, 12, kStepS), {}, {}};
  run.acceleration_m_s2 = output_of({0.13, 0.009, 0.16, 1, 1.9, 0.95}, Channel::acceleration, kStepS, run.duty);
  add_noise(run.acceleration_m_s2, 0.01, 5);
  IdentificationOptions options = unhurried_options();
  options.further_starts = 0;
  options.structure = Structure::first_order;
  const auto claim = StartsWith("the parameters change with amplitude: ");
  const Identification forced = identify(run, options);
  EXPECT_THAT(forced.warnings, Not(Contains(claim)));
  EXPECT_THAT(forced.warnings, Contains(HasSubstr("the likelier reason is that its order was forced")));
  options.structure = Structure::fractional;
  const Identification whole = identify(run, options);
  EXPECT_THAT(whole.warnings, Not(Contains(HasSubstr("with amplitude"))));
}

Recording late_positions(double dead_time_s) {
  constexpr double kNoiseM = 5e-4;
  Recording run{kStepS, prbs_duty(0.6, 0.4, 30, kStepS), {}, {}};
  run.position_m = output_of(kTestedFluid, Channel::position, kStepS, run.duty, dead_time_s);
  add_noise(run.position_m, kNoiseM, 3);
  return run;
}

IdentificationOptions one_fractional_start(bool tries_dead_time) {
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::fractional;
  options.further_starts = 0;
  options.tries_dead_time = tries_dead_time;
  return options;
}

const auto kFollowsDuty = StartsWith("the residuals follow the duty: ");

bool has_doubt(const Identification& found, DoubtCode code) {
  return std::ranges::find(found.doubts, code, &Doubt::code) != found.doubts.end();
}

TEST(InputDoubt, ADeadTimeThatTheModelLacksIsSeenInResidualsThatFollowTheDuty) {
  const Identification late = identify(late_positions(0.04), one_fractional_start(false));
  ASSERT_TRUE(has_doubt(late, DoubtCode::correlated_with_input));
  const auto doubt = std::ranges::find(late.doubts, DoubtCode::correlated_with_input, &Doubt::code);
  EXPECT_EQ(doubt->value, late.input->share);
  EXPECT_TRUE(is_grave(*doubt));
  EXPECT_THAT(late.warnings, Contains(AllOf(kFollowsDuty, HasSubstr("search for a dead time"))));

  const Identification prompt = identify(late_positions(0), one_fractional_start(false));
  EXPECT_FALSE(has_doubt(prompt, DoubtCode::correlated_with_input));
  EXPECT_LT(prompt.input->f, 3);
  EXPECT_THAT(prompt.warnings, Not(Contains(kFollowsDuty)));
}

TEST(InputDoubt, ADeadTimeOfAPositionThatNobodyNamedIsFound) {
  const Identification late = identify(late_positions(0.04), one_fractional_start(true));
  EXPECT_NEAR(late.best.model.dead_time_s, 0.04, 3 * late.best.dead_time_sigma_s.value());
  EXPECT_LT(late.best.dead_time_sigma_s.value(), 0.005);
  EXPECT_FALSE(has_doubt(late, DoubtCode::correlated_with_input));
  EXPECT_THAT(late.warnings, Contains(HasSubstr(" ms was found, which nobody named; a column of the duty that is ")));
  EXPECT_EQ(identify(late_positions(0), one_fractional_start(true)).best.model.dead_time_s, 0);
  const std::vector<Recording> runs{late_positions(0.04), late_positions(0.04)};
  const Identification together = identify_together(runs, one_fractional_start(true));
  EXPECT_NEAR(together.best.model.dead_time_s, 0.04, 3 * together.best.dead_time_sigma_s.value());
}

// A model that is late is no explanation of either.
TEST(InputDoubt, ADriftAndColouredNoiseDoNotFollowTheDuty) {
  Recording drifting = late_positions(0), coloured = late_positions(0);
  std::mt19937 random{11};
  std::normal_distribution<double> fresh{0, 3e-4};
  double noise_m = 0;
  for (std::size_t k = 0; k < drifting.position_m.size(); ++k) {
    drifting.position_m[k] += 2e-3 * kStepS * static_cast<double>(k) / 30;
    noise_m = 0.9 * noise_m + fresh(random);
    coloured.position_m[k] += noise_m;
  }
  for (const Recording& run : {drifting, coloured}) {
    const Identification found = identify(run, one_fractional_start(true));
    EXPECT_FALSE(has_doubt(found, DoubtCode::correlated_with_input)) << found.input->f;
    EXPECT_EQ(found.best.model.dead_time_s, 0);
  }
}

// A lower AIC alone does not show it: a fluid that thins lowers it with a dead time that is not there.
TEST(InputDoubt, ADeadTimeIsTakenOnlyIfTheResidualsHardlyFollowTheDutyWithIt) {
  const auto is_taken = [](double f_left, double f_before, double lower_aic) {
    Fit without, with;
    with.model.dead_time_s = 0.02;
    with.aic = without.aic - lower_aic;
    const std::optional<ScoreEvidence> left = ScoreEvidence{.f = f_left}, before = ScoreEvidence{.f = f_before};
    return is_explained_better({with, left}, {without, before}, false);
  };
  EXPECT_TRUE(is_taken(2.9, 4, 11)) << "nothing that asks for one is left";
  EXPECT_TRUE(is_taken(20, 81, 11)) << "less than a quarter";
  EXPECT_FALSE(is_taken(3.1, 8, 11));
  EXPECT_FALSE(is_taken(2.9, 4, 9));
  EXPECT_FALSE(is_settled_by_dead_time({}, ScoreEvidence{.f = 8})) << "nothing is known of what is left";
}

TEST(InputDoubt, AnOrderThatWasForcedIsNoDeadTime) {
  IdentificationOptions options = one_fractional_start(true);
  options.structure = Structure::first_order;
  const Identification forced = identify(late_positions(0), options);
  EXPECT_EQ(forced.best.model.dead_time_s, 0);
  EXPECT_TRUE(has_doubt(forced, DoubtCode::correlated_with_input));
}

TEST(InputDoubt, WhatAmplitudeExplainsIsCountedOnce) {
  const Identification found = identify(dragged_run(0), one_fractional_start(false));
  ASSERT_TRUE(has_doubt(found, DoubtCode::no_linear_model_over_amplitude));
  EXPECT_FALSE(has_doubt(found, DoubtCode::correlated_with_input));
  EXPECT_THAT(found.warnings, Not(Contains(kFollowsDuty)));
}

}  // namespace
}  // namespace control
