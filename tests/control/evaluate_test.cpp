// A model tried on a recording that it was not fitted to.
#include <gtest/gtest.h>

#include "recorded_runs.hpp"

namespace control {
namespace {

std::vector<double> duties() { return prbs_duty(0.5, 0.4, 20, 0.01); }

TEST(Evaluate, ThePositionsModelLeavesTheNoiseAndFindsTheOffset) {
  Recording recording = position_run(kNonNewtonianModel, duties(), 1e-4, 3);
  for (double& position_m : recording.position_m) position_m += 0.25;
  const Fit fit = evaluate(kNonNewtonianModel, recording);
  EXPECT_NEAR(fit.offset_m, 0.25, 2e-5);
  EXPECT_NEAR(fit.residual_sd, 1e-4, 1e-5);
  EXPECT_TRUE(fit.residuals_are_white);
  EXPECT_NEAR(fit.model.kp, kNonNewtonianModel.kp / kNonNewtonianModel.b3, 1e-12) << "nothing of it is fitted";
  EXPECT_FALSE(fit.one_sigma[0]);
}

TEST(Evaluate, AnotherModelFitsWorseThanTheOneThatIsRight) {
  const Recording recording = position_run(kNonNewtonianModel, duties(), 1e-4, 3);
  FractionalModel stronger = kNonNewtonianModel;
  stronger.kp *= 1.1;
  EXPECT_LT(evaluate(stronger, recording).fit_percent, evaluate(kNonNewtonianModel, recording).fit_percent - 5);
}

TEST(Evaluate, HeedsTheDeadTimeOfTheModel) {
  const std::vector<double> duty = duties();
  Recording recording{0.01, duty, output_of(kNonNewtonianModel, Channel::position, 0.01, duty, 0.137), {}};
  add_noise(recording.position_m, 1e-4, 5);
  FractionalModel late = kNonNewtonianModel;
  late.dead_time_s = 0.137;
  EXPECT_NEAR(evaluate(late, recording).residual_sd, 1e-4, 1e-5);
  EXPECT_GT(evaluate(kNonNewtonianModel, recording).residual_sd, 1e-3);
}

TEST(Evaluate, RefusesARecordingWithoutADuty) {
  Recording recording = position_run(kNonNewtonianModel, duties(), 1e-4, 3);
  recording.duty.assign(recording.duty.size(), 0);
  EXPECT_THROW(evaluate(kNonNewtonianModel, recording), std::invalid_argument);
}

}  // namespace
}  // namespace control
