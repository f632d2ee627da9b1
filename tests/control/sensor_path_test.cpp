// An accelerometer's low pass between ticks, where the robot begins to move.
#include "control/sensor/sensor_path.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "control/search/output_model.hpp"

namespace control {
namespace {

constexpr double kDtS = 0.01, kTimeConstantS = 0.0025;

// Of the acceleration of v = t^power at the time.
double filtered_exactly(double power, double time_s) {
  constexpr int kPieces = 20'000;
  double sum = 0;
  for (int i = 0; i < kPieces; ++i) {
    const double at_s = (i + 0.5) / kPieces * time_s;
    sum += std::exp((at_s - time_s) / kTimeConstantS) * power * std::pow(at_s, power - 1);
  }
  return sum * time_s / kPieces / kTimeConstantS;
}

// A straight line between ticks would give 0.137 in place of 0.156 in the first tick.
TEST(SensorPath, FiltersAMotionByItsMeansToo) {
  constexpr int kTicks = 30;
  constexpr double kPower = 1.45;
  Eigen::VectorXd motion = Eigen::VectorXd::Zero(2 * kTicks);
  for (int k = 1; k < kTicks; ++k) {
    motion[k] = kPower * std::pow(k * kDtS, kPower - 1);
    motion[kTicks + k] = (std::pow(k * kDtS, kPower) - std::pow((k - 1) * kDtS, kPower)) / kDtS;
  }
  SensorReadings readings;
  readings.reading_m_s2.assign(kTicks, 0);
  readings.is_repeated.assign(kTicks, false);
  const SensorPath path{readings, kDtS};
  const Eigen::VectorXd filtered = path.filtered(motion, kTimeConstantS);
  ASSERT_EQ(filtered.size(), kTicks);
  EXPECT_NEAR(filtered[1], filtered_exactly(kPower, kDtS), 0.01);
  for (int k = 2; k < kTicks; ++k) EXPECT_NEAR(filtered[k], filtered_exactly(kPower, k * kDtS), 5e-4) << k;
}

TEST(OutputModel, WithMeansAddsUpToTheVelocity) {
  const std::vector<double> duty(50, 0.3);
  const OutputModel motion = OutputModel::with_means(kDtS, duty, 1e-12);
  const OutputModel velocity{Channel::velocity, kDtS, duty, 0, 1e-12};
  const Eigen::VectorXd output = motion.output(kNonNewtonianModel), slopes = motion.jacobian(kNonNewtonianModel).col(0);
  ASSERT_EQ(output.size(), 100);
  EXPECT_NEAR(kDtS * output.tail(50).sum(), velocity.output(kNonNewtonianModel)[49], 1e-12);
  EXPECT_NEAR(kDtS * slopes.tail(50).sum(), velocity.output(kNonNewtonianModel)[49], 1e-12);  // by ln kp
}

}  // namespace
}  // namespace control
