// The record of an acceleration, less a bias that the robot's filter moves in every fifth tick.
#include "control/sensor/sensor_readings.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace control {
namespace {

struct Record {
  std::vector<double> reading_m_s2, recorded_m_s2;
};

Record record(double quantum_m_s2) {
  std::mt19937 generator(7);
  std::normal_distribution<double> noise(0, 0.012);
  Record made;
  double bias_m_s2 = 0.003;
  for (int k = 0; k < 2000; ++k) {
    if (k % 5 == 0) bias_m_s2 += 0.002 * std::sin(0.02 * k);
    made.reading_m_s2.push_back(quantum_m_s2 * std::round((std::sin(0.03 * k) + noise(generator)) / quantum_m_s2));
    made.recorded_m_s2.push_back(static_cast<double>(static_cast<float>(made.reading_m_s2.back() - bias_m_s2)));
  }
  return made;
}

TEST(SensorReadings, ComeBackWithoutTheBiasOfTheRobotsFilter) {
  const Record made = record(kReadingQuantumM_S2);
  const SensorReadings found = sensor_readings(made.recorded_m_s2);
  ASSERT_TRUE(found.are_recovered);
  const double constant = found.reading_m_s2[0] - made.reading_m_s2[0];
  for (std::size_t k = 0; k < made.reading_m_s2.size(); ++k) {
    EXPECT_NEAR(found.reading_m_s2[k] - made.reading_m_s2[k], constant, 1e-6) << k;
    EXPECT_EQ(found.is_repeated[k], k > 0 && made.reading_m_s2[k] == made.reading_m_s2[k - 1]) << k;
  }
}

TEST(SensorReadings, AreTheRecordWhereNoQuantumShows) {
  const Record made = record(0.0037);
  const SensorReadings found = sensor_readings(made.recorded_m_s2);
  EXPECT_FALSE(found.are_recovered);
  EXPECT_EQ(found.reading_m_s2, made.recorded_m_s2);
}

}  // namespace
}  // namespace control
