// The motor is found in its own response.
#include "control/search/motor_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace control {
namespace {

struct MotorRun {
  std::vector<double> duty, rate_rad_s;
};

MotorRun motor_run(const MotorModel& motor, double dt_s, double first_rate_rad_s, double noise_sd) {
  std::mt19937 generator(9);
  std::normal_distribution<double> noise(0, 1);
  MotorRun run{std::vector<double>(200), {first_rate_rad_s}};
  for (std::size_t k = 0; k < run.duty.size(); ++k) run.duty[k] = k % 60 < 25 ? 0.4 : 0.1;
  const double share = -std::expm1(-dt_s / motor.time_constant_s);
  for (std::size_t k = 0; k + 1 < run.duty.size(); ++k) {
    const double rate = run.rate_rad_s[k];
    run.rate_rad_s.push_back(rate + share * (motor.gain_rad_s * run.duty[k] - rate));
  }
  for (std::size_t k = 1; k < run.duty.size(); ++k) run.rate_rad_s[k] += noise_sd * noise(generator);
  return run;
}

TEST(MotorFit, RecoversTheMotorWithoutNoise) {
  for (const MotorModel& motor : {MotorModel{}, MotorModel{55, 0.4}, MotorModel{2000, 0.006}}) {
    const MotorRun run = motor_run(motor, 0.01, 30, 0);
    const MotorFit fit = fit_motor(0.01, run.duty, run.rate_rad_s);
    EXPECT_NEAR(fit.motor.gain_rad_s / motor.gain_rad_s, 1, 1e-9);
    EXPECT_NEAR(fit.motor.time_constant_s / motor.time_constant_s, 1, 1e-9);
    EXPECT_GT(fit.fit_percent, 99.999);
  }
}

TEST(MotorFit, SigmaIsThatOfTheErrors) {
  const MotorRun run = motor_run({}, 0.01, 0, 3);
  const MotorFit fit = fit_motor(0.01, run.duty, run.rate_rad_s);
  EXPECT_NEAR(fit.residual_sd_rad_s, 3, 0.5);
  EXPECT_NEAR(fit.motor.gain_rad_s, 700, 4 * fit.gain_sigma_rad_s);
  EXPECT_NEAR(fit.motor.time_constant_s, 0.022, 4 * fit.time_constant_sigma_s);
  EXPECT_LT(fit.gain_sigma_rad_s, 3);
  EXPECT_LT(fit.time_constant_sigma_s, 1e-3);
}

TEST(MotorFit, RefusesWhatItCannotUse) {
  const MotorRun run = motor_run({}, 0.01, 0, 0);
  const std::vector<double> none(200, 0.0), few(5, 0.3);
  std::vector<double> broken = run.rate_rad_s, backwards = run.rate_rad_s;
  broken[3] = std::numeric_limits<double>::quiet_NaN();
  for (double& rate : backwards) rate = -rate;
  EXPECT_THROW(fit_motor(0.01, none, run.rate_rad_s), std::invalid_argument);
  EXPECT_THROW(fit_motor(0.01, run.duty, none), std::invalid_argument);
  EXPECT_THROW(fit_motor(0.01, few, few), std::invalid_argument);
  EXPECT_THROW(fit_motor(0.01, {}, {}), std::invalid_argument);
  EXPECT_THROW(fit_motor(0.01, run.duty, few), std::invalid_argument);
  EXPECT_THROW(fit_motor(0.01, run.duty, broken), std::invalid_argument);
  EXPECT_THROW(fit_motor(0.01, run.duty, backwards), std::invalid_argument);
  EXPECT_THROW(fit_motor(-1, run.duty, run.rate_rad_s), std::invalid_argument);
}

}  // namespace
}  // namespace control
