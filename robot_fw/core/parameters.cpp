// The table of parameters.
#include "robot_fw/core/parameters.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "robot_fw/core/crc32.hpp"

namespace robot_fw {
namespace {

// In the order of ParameterId. The position limits always leave room around 0, and the defaults limit nothing that the
// paper's experiments do.
constexpr bool kAnytime = false, kAtRest = true;
constexpr bool kAny = false, kWhole = true;
constexpr EstimatorParameters kEstimator;
constexpr std::array<ParameterSpec, kParameterCount> kTable{{
    {"auto_limit_s", "s", 1, 3600, 600, kAnytime, kAny},
    {"setpoint_limit_m", "m", 0.01F, 100, 1, kAnytime, kAny},
    {"link_timeout_ms", "ms", 100, 5000, 1000, kAnytime, kWhole},
    {"profile_velocity_m_s", "m/s", 0, 10, 0, kAtRest, kAny},
    {"profile_acceleration_m_s2", "m/s2", 0, 100, 0, kAtRest, kAny},
    {"duty_slew_per_s", "1/s", 0, 1000, 0, kAtRest, kAny},
    {"position_limit_min_m", "m", -100, -0.01F, -100, kAtRest, kAny},
    {"position_limit_max_m", "m", 0.01F, 100, 100, kAtRest, kAny},
    {"power_limit_duty", "", 0.1F, 1, 0.9F, kAtRest, kAny},
    {"power_limit_s", "s", 0.1F, 600, 60, kAtRest, kAny},
    {"link_loss_action", "", 0, 2, 0, kAtRest, kWhole},
    {"link_loss_limit_s", "s", 0.1F, 30, 5, kAtRest, kAny},
    {"impedance_monitor", "", 0, 1, 1, kAtRest, kWhole},
    {"impedance_nominal_mv", "mV", 20, 1000, 175, kAtRest, kAny},
    {"impedance_band_mv", "mV", 1, 500, 20, kAtRest, kAny},
    {"impedance_exit_band_mv", "mV", 1, 500, 15, kAtRest, kAny},
    {"delivery_limit_s", "s", 1, 600, 120, kAtRest, kAny},
    {"model_gain_1_m_s", "m/s", -10, 10, kEstimator.model.gain_m_s[0], kAtRest, kAny},
    {"model_gain_2_m_s", "m/s", -10, 10, kEstimator.model.gain_m_s[1], kAtRest, kAny},
    {"model_gain_3_m_s", "m/s", -10, 10, kEstimator.model.gain_m_s[2], kAtRest, kAny},
    {"model_gain_4_m_s", "m/s", -10, 10, kEstimator.model.gain_m_s[3], kAtRest, kAny},
    {"model_time_constant_1_s", "s", 0.001F, 1000, kEstimator.model.time_constant_s[0], kAtRest, kAny},
    {"model_time_constant_2_s", "s", 0.001F, 1000, kEstimator.model.time_constant_s[1], kAtRest, kAny},
    {"model_time_constant_3_s", "s", 0.001F, 1000, kEstimator.model.time_constant_s[2], kAtRest, kAny},
    {"model_time_constant_4_s", "s", 0.001F, 1000, kEstimator.model.time_constant_s[3], kAtRest, kAny},
    {"dead_zone_duty", "", 0, 0.5F, kEstimator.dead_zone_duty, kAtRest, kAny},
    {"doubtful_duty", "", 0, 0.5F, kEstimator.doubtful_duty, kAtRest, kAny},
    {"model_gain_error", "", 0.01F, 1, kEstimator.gain_error, kAtRest, kAny},
    {"model_shape_error", "", 0.001F, 1, kEstimator.shape_error, kAtRest, kAny},
    {"driven_velocity_sd_m_s", "m/s", 0.00001F, 1, kEstimator.driven_velocity_m_s, kAtRest, kAny},
    {"resting_velocity_sd_m_s", "m/s", 0.00001F, 1, kEstimator.resting_velocity_m_s, kAtRest, kAny},
    {"velocity_correlation_s", "s", 0.01F, 10, kEstimator.correlation_s, kAtRest, kAny},
    {"acceleration_noise_m_s2", "m/s2", 0.001F, 1, kEstimator.noise_m_s2, kAtRest, kAny},
    {"acceleration_bias_m_s2", "m/s2", 0.0001F, 1, kEstimator.bias_m_s2, kAtRest, kAny},
    {"acceleration_bias_walk_m_s2", "m/s2", 0.00001F, 0.1F, kEstimator.bias_walk_m_s2, kAtRest, kAny},
    {"model_section_error", "", 0.001F, 1, kEstimator.section_error, kAtRest, kAny},
    {"model_confirmed", "", 0, 1, 0, kAtRest, kWhole},
}};

}  // namespace

const ParameterSpec& Parameters::spec(std::size_t index) { return kTable[index]; }

std::optional<std::size_t> Parameters::find(const char* name) {
  for (std::size_t i = 0; i < kTable.size(); ++i) {
    if (std::strcmp(kTable[i].name, name) == 0) return i;
  }
  return std::nullopt;
}

bool Parameters::in_range(std::size_t index, float value) {
  const ParameterSpec& spec = kTable[index];
  const bool fits = std::isfinite(value) && value >= spec.minimum && value <= spec.maximum;
  return fits && (!spec.whole || std::trunc(value) == value);
}

bool Parameters::is_of_model(std::size_t index) {
  return index >= static_cast<std::size_t>(ParameterId::model_gain_1_m_s) &&
         index < static_cast<std::size_t>(ParameterId::dead_zone_duty);
}

void Parameters::set_defaults() {
  for (std::size_t i = 0; i < kTable.size(); ++i) values_[i] = kTable[i].default_value;
}

LinkLossAction Parameters::link_loss_action() const {
  const float action = (*this)[ParameterId::link_loss_action];
  if (action == 1) return LinkLossAction::hold;
  return action == 2 ? LinkLossAction::go_on : LinkLossAction::stop;
}

ImpedanceRules Parameters::impedance() const {
  return {(*this)[ParameterId::impedance_nominal_mv], (*this)[ParameterId::impedance_band_mv],
          (*this)[ParameterId::impedance_exit_band_mv]};
}

EstimatorParameters Parameters::estimator() const {
  EstimatorParameters estimator;
  const float* const gains = &values_[static_cast<std::size_t>(ParameterId::model_gain_1_m_s)];
  const float* const time_constants = &values_[static_cast<std::size_t>(ParameterId::model_time_constant_1_s)];
  std::copy_n(gains, kModelSections, estimator.model.gain_m_s.begin());
  std::copy_n(time_constants, kModelSections, estimator.model.time_constant_s.begin());
  estimator.dead_zone_duty = (*this)[ParameterId::dead_zone_duty];
  estimator.doubtful_duty = (*this)[ParameterId::doubtful_duty];
  estimator.gain_error = (*this)[ParameterId::model_gain_error];
  estimator.shape_error = (*this)[ParameterId::model_shape_error];
  estimator.driven_velocity_m_s = (*this)[ParameterId::driven_velocity_sd_m_s];
  estimator.resting_velocity_m_s = (*this)[ParameterId::resting_velocity_sd_m_s];
  estimator.correlation_s = (*this)[ParameterId::velocity_correlation_s];
  estimator.noise_m_s2 = (*this)[ParameterId::acceleration_noise_m_s2];
  estimator.bias_m_s2 = (*this)[ParameterId::acceleration_bias_m_s2];
  estimator.bias_walk_m_s2 = (*this)[ParameterId::acceleration_bias_walk_m_s2];
  estimator.section_error = (*this)[ParameterId::model_section_error];
  estimator.is_confirmed = (*this)[ParameterId::model_confirmed] == 1;
  return estimator;
}

std::uint32_t Parameters::checksum() const {
  Crc32 crc;
  for (std::size_t i = 0; i < kTable.size(); ++i) {
    crc.add(kTable[i].name, std::strlen(kTable[i].name));
    crc.add_float(values_[i]);
  }
  return crc.value();
}

}  // namespace robot_fw
