// Looks for the quantum in the steps of the record and follows the remainder.
#include "control/sensor/sensor_readings.hpp"

#include <cmath>
#include <cstddef>

namespace control {
namespace {

constexpr double kSharpness = 2e-4;   // of the quantum: the record is in binary32
constexpr double kShareOnGrid = 0.6;  // of steps that are whole quanta; 0.8 are expected, chance gives 0.0004

double remainder_of(double quanta) { return quanta - std::round(quanta); }

bool shows_quantum(std::span<const double> recorded) {
  std::size_t whole = 0;
  for (std::size_t k = 1; k < recorded.size(); ++k) {
    const double step = (recorded[k] - recorded[k - 1]) / kReadingQuantumM_S2;
    if (std::abs(remainder_of(step)) < kSharpness) ++whole;
  }
  return static_cast<double>(whole) > kShareOnGrid * static_cast<double>(recorded.size());
}

}  // namespace

SensorReadings sensor_readings(std::span<const double> recorded) {
  SensorReadings result;
  result.are_recovered = shows_quantum(recorded);
  double bias = 0, last_remainder = 0;  // b, in quanta
  for (std::size_t k = 0; k < recorded.size(); ++k) {
    const double remainder = remainder_of(-recorded[k] / kReadingQuantumM_S2);
    bias += k == 0 ? remainder : remainder_of(remainder - last_remainder);
    last_remainder = remainder;
    const double added_m_s2 = result.are_recovered ? kReadingQuantumM_S2 * bias : 0;
    result.reading_m_s2.push_back(recorded[k] + added_m_s2);  // (1)
    const double step = k == 0 ? 1 : std::abs(result.reading_m_s2[k] - result.reading_m_s2[k - 1]);
    result.is_repeated.push_back(step < 1e-3 * kReadingQuantumM_S2);
  }
  return result;
}

}  // namespace control
