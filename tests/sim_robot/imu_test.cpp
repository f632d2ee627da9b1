// The simulated accelerometer has the faults that its header states.
#include "sim_robot/world/imu.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace sim_robot {
namespace {

ImuParameters silent() {
  ImuParameters parameters;
  parameters.noise_m_s2_rthz = parameters.offset_m_s2 = parameters.wander_m_s2 = parameters.drift_m_s3 = 0;
  parameters.clock_error = parameters.missed_read_probability = 0;
  return parameters;
}

TEST(Imu, CountsHundredthsOfAMetrePerSecondSquared) {
  Imu imu{silent(), 1};
  for (int k = 0; k < 3; ++k) imu.accelerate(-1.234);
  EXPECT_EQ(imu.read().counts, -123);
  EXPECT_TRUE(imu.read().is_valid);
}

TEST(Imu, MeasuresTheShareThatLiesAlongItsAxis) {
  for (const double cosine : {-1.0, 0.0, 0.5}) {
    ImuParameters parameters = silent();
    parameters.axis_cosine = cosine;
    Imu imu{parameters, 1};
    for (int k = 0; k < 10; ++k) imu.accelerate(2);
    EXPECT_EQ(imu.read().counts, 200 * cosine);
  }
  EXPECT_THROW(check(ImuParameters{.axis_cosine = 1.5}), std::invalid_argument);
}

TEST(Imu, SaturatesInsteadOfWrapping) {
  Imu imu{silent(), 1};
  for (int k = 0; k < 3; ++k) imu.accelerate(1e6);
  EXPECT_EQ(imu.read().counts, 32767);
}

TEST(Imu, HasTheNoiseOfTheDataSheetsBand) {
  ImuParameters parameters = silent();
  parameters.noise_m_s2_rthz = 0.0116 / std::sqrt(62.5);
  Imu imu{parameters, 1};
  double sum = 0, squares = 0;
  constexpr int kReadings = 20'000;
  for (int k = 0; k < kReadings; ++k) {
    imu.accelerate(0);
    const double reading = imu.read().counts / Imu::kCountsPerMS2;
    sum += reading;
    squares += reading * reading;
  }
  const double mean = sum / kReadings;
  EXPECT_NEAR(mean, imu.bias_m_s2(), 3e-4);
  EXPECT_NEAR(std::sqrt(squares / kReadings - mean * mean), std::hypot(0.0116, 0.01 / std::sqrt(12)), 3e-4);
}

TEST(Imu, StartsWithWhatTheCalibrationLeavesOfTheOffset) {
  double squares = 0;
  constexpr int kImus = 500;
  for (int seed = 0; seed < kImus; ++seed) squares += std::pow(Imu{{}, static_cast<unsigned>(seed)}.bias_m_s2(), 2);
  EXPECT_NEAR(std::sqrt(squares / kImus), 0.0116 / std::sqrt(200), 1e-4);  // of 0.11 m/s² rms
}

TEST(Imu, DriftsByTenMicroGInASecondEitherWay) {
  ImuParameters parameters = silent();
  parameters.drift_m_s3 = 0.000098;
  int upwards = 0;
  for (unsigned seed = 0; seed < 100; ++seed) {
    Imu imu{parameters, seed};
    for (int k = 0; k < 1000; ++k) imu.accelerate(0);
    EXPECT_NEAR(std::abs(imu.bias_m_s2()), 0.00098, 1e-9);
    if (imu.bias_m_s2() > 0) ++upwards;
  }
  EXPECT_NEAR(upwards, 50, 20);
}

TEST(Imu, RepeatsAndSkipsReadingsByItsOwnClock) {
  ImuParameters parameters = silent();
  parameters.clock_error = 0.005;
  int repeated = 0, skipped = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    Imu imu{parameters, seed};
    int last = imu.read().counts;
    for (int k = 1; k < 1000; ++k) {
      imu.accelerate(0.1 * k);  // 10 counts a tick
      const int counts = imu.read().counts;
      if (counts == last) ++repeated;
      if (counts - last > 15) ++skipped;
      last = counts;
    }
  }
  EXPECT_GT(repeated, 5);
  EXPECT_LT(repeated, 60);
  EXPECT_GT(skipped, 5);
  EXPECT_LT(skipped, 60);
}

TEST(Imu, MissesReadsAsOftenAsConfigured) {
  ImuParameters parameters = silent();
  parameters.missed_read_probability = 0.1;
  Imu imu{parameters, 1};
  int missed = 0;
  for (int k = 0; k < 10'000; ++k) missed += imu.read().is_valid ? 0 : 1;
  EXPECT_NEAR(missed, 1000, 100);
}

// Of a vibration of f Hz, 1/sqrt(1 + (f/B)²) is left; and all of the velocity that it adds up to.
TEST(Imu, SmoothsFastMotionAndLosesNoVelocity) {
  ImuParameters parameters = silent();
  parameters.bandwidth_hz = 5;
  Imu imu{parameters, 1};
  double largest = 0, sum = 0;
  for (int k = 0; k < 2000; ++k) {
    imu.accelerate(10 * std::sin(2 * std::numbers::pi * 5 * 0.01 * k));
    if (k > 1000) largest = std::max(largest, imu.read().counts / Imu::kCountsPerMS2);
  }
  EXPECT_NEAR(largest, 10 / std::sqrt(2), 0.15);
  Imu pushed{parameters, 1};
  for (int k = 0; k < 200; ++k) {
    pushed.accelerate(k > 20 && k <= 30 ? 5 : 0);
    sum += pushed.read().counts / Imu::kCountsPerMS2;
  }
  EXPECT_NEAR(0.01 * sum, 0.5, 0.01);
}

TEST(Imu, FeelsTheMeanOfATickAndNotOnlyItsEnds) {
  Imu imu{silent(), 1};
  double sum = 0;
  for (int k = 0; k < 20; ++k) {
    imu.accelerate(0, k == 0 ? 1 : 0);
    sum += imu.read().counts / Imu::kCountsPerMS2;
  }
  EXPECT_NEAR(sum, 0.81, 0.03);  // the rest is lost between two samples
}

TEST(Imu, IsStuckAtItsLastReadingUntilTheFaultEnds) {
  Imu imu{{}, 1};
  for (int k = 0; k < 10; ++k) imu.accelerate(1);
  imu.set_fault({.kind = SensorFaultKind::stuck});
  const int stuck = imu.read().counts;
  for (int k = 0; k < 100; ++k) {
    imu.accelerate(-3);
    ASSERT_EQ(imu.read().counts, stuck);
  }
  imu.set_fault({});
  for (int k = 0; k < 3; ++k) imu.accelerate(-3);
  EXPECT_NEAR(imu.read().counts, -300, 10);
}

TEST(Imu, ThatIsMissingGivesNoReading) {
  Imu imu{silent(), 1};
  imu.set_fault({.kind = SensorFaultKind::missing});
  EXPECT_FALSE(imu.read().is_valid);
}

TEST(Imu, CanBeOffOrNoisyOnTop) {
  Imu imu{silent(), 1};
  imu.set_fault({SensorFaultKind::offset, 0.5});
  for (int k = 0; k < 3; ++k) imu.accelerate(1);
  EXPECT_EQ(imu.read().counts, 150);
  EXPECT_EQ(imu.bias_m_s2(), 0);
  imu.set_fault({SensorFaultKind::noisy, 0.3});
  double squares = 0;
  constexpr int kReadings = 5000;
  for (int k = 0; k < kReadings; ++k) {
    imu.accelerate(0);
    squares += std::pow(imu.read().counts / Imu::kCountsPerMS2, 2);
  }
  EXPECT_NEAR(std::sqrt(squares / kReadings), 0.3, 0.02);
}

TEST(Imu, RefusesAProbabilityBeyondOne) {
  ImuParameters parameters;
  parameters.missed_read_probability = 1.5;
  EXPECT_THROW((Imu{parameters, 1}), std::invalid_argument);
}

}  // namespace
}  // namespace sim_robot
