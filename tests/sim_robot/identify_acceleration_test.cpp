// From the telemetry of a robot that only has its accelerometer, identification finds the fluid and not the belief.
#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "control/responses/margins.hpp"
#include "tests/sim_robot/identification_trial.hpp"

namespace sim_robot {
namespace {

const control::FractionalModel kFluid = kStudyFluids[1];

// tests/bench/identification_study.cpp runs all fluids and 40 seeds.
class IdentifyAcceleration : public ::testing::TestWithParam<std::uint64_t> {};

TEST_P(IdentifyAcceleration, FindsAFluidThatTheRobotDoesNotBelieveInWithSigmasThatHold) {
  const TrialFit found = fit_of(record({.fluid = kFluid, .duty = study_duty()}, GetParam()), kFluid);
  EXPECT_LE(found.worst_response, 0.02);
  EXPECT_LE(found.worst_sigmas, 3);
  EXPECT_LE(found.worst_sigma_by_bound, 2);
  EXPECT_GT(found.fit.whiteness_p_value, 0.001);
  ASSERT_TRUE(found.fit.sensor);
  EXPECT_TRUE(found.fit.sensor->readings_are_recovered);
  EXPECT_TRUE(found.fit.sensor->has_own_clock);
}

INSTANTIATE_TEST_SUITE_P(Seeds, IdentifyAcceleration, ::testing::Range<std::uint64_t>(1, 11));

// The record leaves the sensor's low pass open, and a short one looks like a higher alpha: the residuals of both are
// white. Without the data sheet a fit ended 5 to 7 sigmas off, from one start (seed 1017) or from five (seed 1016).
TEST(IdentifyAcceleration, ALowPassThatTheRecordLeavesOpenIsThatOfTheDataSheet) {
  const control::FractionalModel fluid{0.08659, 0.006733, 0.07212, 1, 1.3678, 0.6265};
  for (const auto& [seed, further_starts] : {std::pair{1017U, 0}, {1016U, 4}}) {
    control::IdentificationOptions options = one_start_options();
    options.further_starts = further_starts;
    const control::Fit fit = control::identify(record_played(TEST_DATA_DIR "/fluid_g.toml", seed), options).best;
    EXPECT_LE(std::abs(fit.model.alpha - fluid.alpha), 2.5 * *fit.one_sigma[3]) << seed;
    EXPECT_LE(std::abs(fit.model.b1 - fluid.b1), 2.5 * *fit.one_sigma[1]) << seed;
    EXPECT_NEAR(fit.sensor->time_constant_s, 0.0025, 0.0006) << seed;
    EXPECT_LE(*fit.one_sigma[3], 0.02) << seed;  // and it makes the fit surer, not less so
    EXPECT_TRUE(fit.residuals_are_white) << seed;
  }
}

TEST(IdentifyBelief, TwoRobotsThatBelieveInDifferentFluidsFindTheSame) {
  const auto found = [](bool believes_in_water) {
    return fit_of(record({kFluid, believes_in_water, study_duty()}, 3), kFluid).fit.model;
  };
  EXPECT_LE(worst_response_error(found(true), found(false)), 0.01);
}

TEST(IdentifyBelief, ADeadTimeOfTheFluidIsFound) {
  const auto duty = control::prbs_duty(0.6, 0.5, 20, 0.01);
  const control::Recording recording = record({.fluid = kFluid, .duty = duty, .dead_time_s = 0.07}, 2);
  control::IdentificationOptions options = one_start_options();
  options.longest_dead_time_s = 0.2;
  const control::Fit fit = control::identify(recording, options).best;
  EXPECT_NEAR(fit.model.dead_time_s, 0.07, 0.002);
  control::FractionalModel prompt = fit.model, truth = kFluid;
  prompt.dead_time_s = 0;
  EXPECT_LE(worst_response_error(prompt, kFluid), 0.03);
  truth.dead_time_s = 0.07;  // what was found is in what is computed of it: without, the margin is 20 degrees more
  const auto margin_deg = [](const control::FractionalModel& plant) {
    return control::margins({plant, control::kPaperController}).phase_margin_deg.value();
  };
  EXPECT_NEAR(margin_deg(fit.model), margin_deg(truth), 2);
  EXPECT_GT(margin_deg(prompt), margin_deg(truth) + 15);
}

}  // namespace
}  // namespace sim_robot
