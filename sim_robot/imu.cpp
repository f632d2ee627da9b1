// Draws the sensor's faults from one seed and keeps its clock.
#include "sim_robot/imu.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace sim_robot {

Imu::Imu(const ImuParameters& parameters, std::uint64_t seed) : parameters_(parameters), random_(seed) {
  const double missed = parameters.missed_read_probability;
  if (!(missed >= 0 && missed <= 1)) {
    throw std::invalid_argument("missed_read_probability " + std::to_string(missed) + " is not in [0, 1]");
  }
  sample_period_s_ = kPeriodS * (1 + parameters.clock_error * (2 * uniform_(random_) - 1));
  until_sample_s_ = sample_period_s_ * uniform_(random_);
  drift_m_s3_ = uniform_(random_) < 0.5 ? -parameters.drift_m_s3 : parameters.drift_m_s3;
  wander_m_s2_ = parameters.wander_m_s2 * normal();

  const double bias_m_s2 = parameters.offset_m_s2 * (2 * uniform_(random_) - 1) + wander_m_s2_;
  const auto samples = std::max(1L, std::lround(parameters.calibration_s / kPeriodS));
  double sum_m_s2 = 0;
  for (long i = 0; i < samples; ++i) sum_m_s2 += bias_m_s2 + parameters.noise_m_s2 * normal();
  residual_m_s2_ = bias_m_s2 - sum_m_s2 / static_cast<double>(samples) - wander_m_s2_;  // (2)
  counts_ = sample(0);
}

void Imu::accelerate(double acceleration_m_s2, double dt_s) {
  const double decay = std::exp(-dt_s / parameters_.wander_time_s);
  wander_m_s2_ = decay * wander_m_s2_ + parameters_.wander_m_s2 * std::sqrt(1 - decay * decay) * normal();  // (3)
  drift_m_s2_ += drift_m_s3_ * dt_s;
  while (until_sample_s_ <= dt_s) {
    counts_ = sample(std::lerp(acceleration_m_s2_, acceleration_m_s2, until_sample_s_ / dt_s));
    until_sample_s_ += sample_period_s_;
  }
  until_sample_s_ -= dt_s;
  acceleration_m_s2_ = acceleration_m_s2;
}

ImuReading Imu::read() { return {counts_, uniform_(random_) >= parameters_.missed_read_probability}; }

std::int16_t Imu::sample(double acceleration_m_s2) {
  using Limits = std::numeric_limits<std::int16_t>;
  const double counts = kCountsPerMS2 * (acceleration_m_s2 + bias_m_s2() + parameters_.noise_m_s2 * normal());  // (1)
  return static_cast<std::int16_t>(std::lround(std::clamp<double>(counts, Limits::min(), Limits::max())));
}

}  // namespace sim_robot
