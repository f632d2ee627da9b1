// A model tried on a recording that it was not fitted to.
#include <gtest/gtest.h>

#include "control/sensor/sensor_path.hpp"
#include "recorded_runs.hpp"

namespace control {
namespace {

std::vector<double> duties() { return prbs_duty(0.5, 0.4, 20, 0.01); }

constexpr double kActsLateS = 0.12, kReadingSd = 0.002;

FractionalModel late_by(double dead_time_s) {
  FractionalModel model{0.1, 0.006, 0.11, 1, 2, 1};
  model.dead_time_s = dead_time_s;
  return model;
}

// Of an accelerometer in step with the ticks, its readings three quarters of one old.
Recording readings_of_a_late_robot() {
  Recording recording{0.01, prbs_duty(0.6, 0.2, 8, 0.01), {}, {}};
  const Eigen::VectorXd felt_m_s2 = OutputModel::with_means(0.01, recording.duty, 1e-9).output(late_by(0));
  const std::vector<double> unread(recording.duty.size());
  const SensorPath path({unread, std::vector<bool>(unread.size()), false}, 0.01);
  const Eigen::VectorXd readings = path.sampled(felt_m_s2, {-0.0075 - kActsLateS, 0.01, 0.0025});
  recording.acceleration_m_s2.assign(readings.begin(), readings.end());
  add_noise(recording.acceleration_m_s2, kReadingSd, 5);
  return recording;
}

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

TEST(Evaluate, AnAccelerationIsExplainedWorseWithAnotherDeadTime) {
  const Recording recording = readings_of_a_late_robot();
  IdentificationOptions options = unhurried_options();
  options.further_starts = 0;
  const Fit right = evaluate(late_by(kActsLateS), recording, options);
  EXPECT_NEAR(right.residual_sd / kReadingSd, 1, 0.1);
  EXPECT_EQ(right.model.dead_time_s, kActsLateS);
  ASSERT_TRUE(right.sensor);
  EXPECT_NEAR(right.sensor->delay_s, 0.0075, 1e-3) << "the age of the readings, without the dead time";
  for (const double wrong_s : {0.0, 0.02, 0.16, 0.52}) {
    EXPECT_LT(evaluate(late_by(wrong_s), recording, options).fit_percent, right.fit_percent - 5) << wrong_s;
  }
  const Fit hidden = evaluate(late_by(kActsLateS - 0.03), recording, options);
  EXPECT_NEAR(hidden.fit_percent, right.fit_percent, 0.1) << "readings that are so old look the same";
}

TEST(Evaluate, RefusesARecordingWithoutADuty) {
  Recording recording = position_run(kNonNewtonianModel, duties(), 1e-4, 3);
  recording.duty.assign(recording.duty.size(), 0);
  EXPECT_THROW(evaluate(kNonNewtonianModel, recording), std::invalid_argument);
}

}  // namespace
}  // namespace control
