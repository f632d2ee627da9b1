// A robot holds its duty for a period: what that costs is shown beside what was asked for, and judged.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "control/responses/frequency_response.hpp"
#include "control/tuning/tune.hpp"

namespace control {
namespace {

using testing::HasSubstr;

TEST(SampledTuning, RefusesWhatIsUnstableAsTheRobotRunsIt) {
  TuningSpec spec{60, 15};
  ASSERT_TRUE(tune(kNonNewtonianModel, spec).is_feasible) << "in the paper's loop, which is not sampled";
  spec.period_s = 0.01;
  const TuningResult result = tune(kNonNewtonianModel, spec);
  EXPECT_FALSE(result.is_feasible);
  EXPECT_THAT(result.reason, HasSubstr("unstable as the robot runs it, which holds its duty for 0.01 s"));
  ASSERT_TRUE(result.refused);
  EXPECT_TRUE(result.refused->achieved.is_closed_loop_stable);
  EXPECT_FALSE(result.refused->sampled.is_closed_loop_stable);
  ASSERT_FALSE(result.nearest.empty());
  for (const TunedController& offer : result.nearest) EXPECT_TRUE(offer.sampled.is_closed_loop_stable) << offer.name;
  EXPECT_THROW(tune(kNonNewtonianModel, {5, 91, std::nullopt, false, -0.01}), std::invalid_argument);
}

TEST(SampledTuning, TheHoldCostsThePhaseOfHalfAPeriod) {
  const TuningResult result = tune(kNonNewtonianModel, {5, 91, std::nullopt, false, 0.01});
  ASSERT_TRUE(result.is_feasible);
  EXPECT_NEAR(*result.tuned->achieved.phase_margin_deg, 91, 1e-7);
  EXPECT_NEAR(*result.tuned->sampled.phase_margin_deg, 91 - 5 * 0.005 * kDegPerRad, 1e-7);
  EXPECT_FALSE(result.tuned->achieved.gain_margin_db) << "infinite in the continuous loop only";
  EXPECT_TRUE(result.tuned->sampled.gain_margin_db);
}

}  // namespace
}  // namespace control
