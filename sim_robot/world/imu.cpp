// Draws the sensor's errors from one seed and keeps its clock.
#include "sim_robot/world/imu.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/invalid_argument.hpp"
#include "sim_robot/world/tick.hpp"

namespace sim_robot {
namespace {

void check_between(const char* name, double value, double least, double most) {
  if (!(value >= least && value <= most)) {
    base::throw_invalid("IMU: ", name, " must be in [", least, ", ", most, "], is ", value);
  }
}

}  // namespace

void check(const ImuParameters& p) {
  check_between("noise_m_s2_rthz", p.noise_m_s2_rthz, 0, 100);
  check_between("bandwidth_hz", p.bandwidth_hz, 0.1, 1e6);
  check_between("offset_m_s2", p.offset_m_s2, 0, 100);
  check_between("calibration_s", p.calibration_s, 0, 3600);
  check_between("wander_m_s2", p.wander_m_s2, 0, 100);
  check_between("wander_time_s", p.wander_time_s, 0.01, 1e9);
  check_between("drift_m_s3", p.drift_m_s3, -1, 1);
  check_between("clock_error", p.clock_error, 0, 0.1);
  check_between("missed_read_probability", p.missed_read_probability, 0, 1);
  check_between("axis_cosine", p.axis_cosine, -1, 1);
}

Imu::Imu(const ImuParameters& parameters, std::uint64_t seed)
    : noise_(seed),
      noise_m_s2_(parameters.noise_m_s2_rthz * std::sqrt(parameters.bandwidth_hz)),
      wander_decay_(std::exp(-kTickS / parameters.wander_time_s)),
      wander_step_m_s2_(parameters.wander_m_s2 * std::sqrt(1 - wander_decay_ * wander_decay_)),
      missed_read_probability_(parameters.missed_read_probability),
      axis_cosine_(parameters.axis_cosine) {
  check(parameters);
  const double turns = 2 * std::numbers::pi * parameters.bandwidth_hz * kTickS;
  filter_decay_ = std::exp(-turns);
  filter_late_share_ = 1 - (1 - filter_decay_) / turns;
  filter_bend_share_ = 6 * (turns - 2 + (turns + 2) * filter_decay_) / (turns * turns);
  sample_period_s_ = kTickS * (1 + parameters.clock_error * (2 * noise_.uniform() - 1));
  until_sample_s_ = sample_period_s_ * noise_.uniform();
  drift_m_s3_ = noise_.uniform() < 0.5 ? -parameters.drift_m_s3 : parameters.drift_m_s3;
  wander_m_s2_ = parameters.wander_m_s2 * noise_.normal();

  const double bias_m_s2 = parameters.offset_m_s2 * (2 * noise_.uniform() - 1) + wander_m_s2_;
  const auto samples = std::max(1L, std::lround(parameters.calibration_s / kTickS));
  double sum_m_s2 = 0;
  for (long i = 0; i < samples; ++i) sum_m_s2 += bias_m_s2 + noise_m_s2_ * noise_.normal();
  residual_m_s2_ = bias_m_s2 - sum_m_s2 / static_cast<double>(samples) - wander_m_s2_;  // (2)
  counts_ = sample(0);
}

void Imu::accelerate(double acceleration_m_s2, double mean_m_s2) {
  wander_m_s2_ = wander_decay_ * wander_m_s2_ + wander_step_m_s2_ * noise_.normal();  // (3)
  drift_m_s2_ += drift_m_s3_ * kTickS;
  const double driven_m_s2 = (1 - filter_decay_) * acceleration_m_s2_ +
                             filter_late_share_ * (acceleration_m_s2 - acceleration_m_s2_) +
                             filter_bend_share_ * (mean_m_s2 - (acceleration_m_s2 + acceleration_m_s2_) / 2);
  const double filtered_m_s2 = filter_decay_ * filtered_m_s2_ + axis_cosine_ * driven_m_s2;  // (4), (5)
  while (until_sample_s_ <= kTickS) {
    counts_ = sample(std::lerp(filtered_m_s2_, filtered_m_s2, until_sample_s_ / kTickS));
    until_sample_s_ += sample_period_s_;
  }
  until_sample_s_ -= kTickS;
  acceleration_m_s2_ = acceleration_m_s2;
  filtered_m_s2_ = filtered_m_s2;
}

ImuReading Imu::read() {
  const bool is_missed = noise_.uniform() < missed_read_probability_;
  return {counts_, !is_missed && fault_.kind != SensorFaultKind::missing};
}

double Imu::fault_m_s2() {
  if (fault_.kind == SensorFaultKind::offset) return fault_.magnitude;
  if (fault_.kind == SensorFaultKind::noisy) return fault_.magnitude * noise_.normal();
  return 0;
}

std::int16_t Imu::sample(double acceleration_m_s2) {
  using Limits = std::numeric_limits<std::int16_t>;
  const double sensed_m_s2 = acceleration_m_s2 + bias_m_s2() + noise_m_s2_ * noise_.normal() + fault_m_s2();
  if (fault_.kind == SensorFaultKind::stuck) return counts_;
  const double counts = std::clamp<double>(kCountsPerMS2 * sensed_m_s2, Limits::min(), Limits::max());
  return static_cast<std::int16_t>(std::lround(counts));  // (1)
}

}  // namespace sim_robot
