// What of a run's residuals is put down to amplitude: a drag behind a dead time is, an order that was forced is not.
#include "control/identification/amplitude_doubt.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "recorded_runs.hpp"

namespace control {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr double kPeriodS = 0.01;
constexpr FractionalModel kFluid{0.1, 0.0045, 0.15, 1, 1.75, 0.85};

// The velocity of a fluid with a little drag that grows with the square of the speed, to the first order in it.
Recording dragged_run(double dead_time_s) {
  constexpr double kDrag = 30, kNoiseM_S = 1e-6;
  Recording run{kPeriodS, prbs_duty(0.6, 0.4, 20, kPeriodS), {}, {}};
  std::vector<double> drag = output_of(kFluid, Channel::velocity, kPeriodS, run.duty);
  for (double& velocity : drag) velocity *= kDrag * std::abs(velocity);
  run.velocity_m_s = output_of(kFluid, Channel::velocity, kPeriodS, run.duty, dead_time_s);
  const std::vector<double> slower = output_of(kFluid, Channel::velocity, kPeriodS, drag, dead_time_s);
  for (std::size_t k = 0; k < slower.size(); ++k) run.velocity_m_s[k] -= slower[k];
  add_noise(run.velocity_m_s, kNoiseM_S, 3);
  return run;
}

// Of the true fluid, as if it had been found.
ScoreEvidence evidence_of(const Recording& run, double dead_time_s) {
  IdentificationOptions options = unhurried_options();
  options.longest_dead_time_s = 1;
  OutputErrorSearch search(run, options);
  SearchPoint point{kFluid};
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
  Recording run{kPeriodS, prbs_duty(0.6, 0.5, 12, kPeriodS), {}, {}};
  run.acceleration_m_s2 = output_of({0.13, 0.009, 0.16, 1, 1.9, 0.95}, Channel::acceleration, kPeriodS, run.duty);
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

}  // namespace
}  // namespace control
