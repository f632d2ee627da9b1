// The parameters of the firmware that a station may set: one table with name, unit, range and default.
//
// The checksum covers, in the order of the table, the characters of each name and then its value as 4 bytes,
// little-endian: another table or another value gives another checksum.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "robot_fw/core/estimator.hpp"
#include "robot_fw/core/impedance_monitor.hpp"

namespace robot_fw {

enum class ParameterId : std::uint8_t {
  auto_limit_s,               // auto ends by itself after this; from the next entry into auto on
  setpoint_limit_m,           // setpoints and disturbances lie in [-limit, limit]
  link_timeout_ms,            // when Welcome leaves it to the robot; from the next Welcome on
  profile_velocity_m_s,       // of the reference; 0: no limit
  profile_acceleration_m_s2,  // of the reference; 0: no limit
  duty_slew_per_s,            // how fast the duty may change; 0: no limit
  position_limit_min_m,       // below it: emergency
  position_limit_max_m,       // above it: emergency
  power_limit_duty,           // above this |duty| the motor is at power
  power_limit_s,              // longer at power: emergency
  link_loss_action,           // LinkLossAction
  link_loss_limit_s,          // of auto without a link, unless the action is stop
  impedance_monitor,          // 1: on; 0: off, neither detections nor faults of the electrode
  impedance_nominal_mv,       // without glucose
  impedance_band_mv,          // beyond it: glucose
  impedance_exit_band_mv,     // within it: mixed
  delivery_limit_s,
  // Of the estimator, in the order of EstimatorParameters.
  model_gain_1_m_s,
  model_time_constant_1_s = model_gain_1_m_s + 4,
  dead_zone_duty = model_time_constant_1_s + 4,
  doubtful_duty,
  model_gain_error,
  model_shape_error,
  driven_velocity_sd_m_s,
  resting_velocity_sd_m_s,
  velocity_correlation_s,
  acceleration_noise_m_s2,
  acceleration_bias_m_s2,
  acceleration_bias_walk_m_s2,
  model_section_error,
  model_confirmed,  // 1: the model is that of the fluid that the robot swims in; 0 after each boot
};
constexpr std::size_t kParameterCount = static_cast<std::size_t>(ParameterId::model_confirmed) + 1;

// What auto does when the link is lost; manual always stops.
enum class LinkLossAction : std::uint8_t { stop, hold, go_on };

struct ParameterSpec {
  const char* name;
  const char* unit;
  float minimum;
  float maximum;
  float default_value;
  bool only_at_rest;  // refused while the motor is on
  bool whole;         // a whole number
};

class Parameters {
 public:
  Parameters() { set_defaults(); }

  static const ParameterSpec& spec(std::size_t index);
  static std::optional<std::size_t> find(const char* name);
  // Finite, within the range of its row, and a whole number where the row requires one.
  static bool in_range(std::size_t index, float value);
  // A gain or time constant of the estimator's model.
  static bool is_of_model(std::size_t index);

  float operator[](ParameterId id) const { return values_[static_cast<std::size_t>(id)]; }
  float value(std::size_t index) const { return values_[index]; }
  // The value must be in_range().
  void set(std::size_t index, float value) { values_[index] = value; }
  void set(ParameterId id, float value) { set(static_cast<std::size_t>(id), value); }
  void set_defaults();

  LinkLossAction link_loss_action() const;
  ImpedanceRules impedance() const;
  EstimatorParameters estimator() const;

  std::uint32_t checksum() const;

 private:
  std::array<float, kParameterCount> values_{};
};

}  // namespace robot_fw
