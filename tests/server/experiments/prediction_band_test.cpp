// The position that a robot measures in closed loop is within the band that was predicted: the small form of
// tests/bench/prediction_study.cpp, in which the models are drawn and not fitted.
#include <gtest/gtest.h>

#include <span>

#include "tests/server/experiments/prediction_trial.hpp"
#include "tests/sim_robot/identification_trial.hpp"

namespace server::experiments {
namespace {

TEST(PredictionBand, HoldsNinetyPercentOfTheMeasuredPositionsAndIsNoWiderThanThreeTimesTheirRms) {
  BandTally tally;
  for (const auto& fluid : std::span{sim_robot::kStudyFluids}.first(4)) {
    tally.add(run_of({.fluid = fluid, .seed = 101, .model_from = ModelFrom::drawn}));
  }
  EXPECT_GE(tally.share_within(), 0.9);
  EXPECT_LE(tally.half_width_rms_m(), 3 * tally.rms_m());
  EXPECT_GE(tally.share_true_within(), 0.9);
  EXPECT_LT(tally.share_within_before(), 0.2) << "the parameters alone say little of what is measured";
}

}  // namespace
}  // namespace server::experiments
