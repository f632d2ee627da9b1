// Feeds the estimator and watches the accelerometer.
#include "robot_fw/core/motion_sense.hpp"

#include <algorithm>

namespace robot_fw {
namespace {

constexpr float kLongestStepS = 0.1F;  // of the estimator; by then a motor that is off has stopped the robot
constexpr float kSmallestSdM = 0.0001F;
constexpr float kSdStep = 1.4F;

float in_steps(float shown_m, float sd_m) {
  const float at_least_m = std::max(sd_m, kSmallestSdM);
  const bool fits = at_least_m <= shown_m && 2 * at_least_m >= shown_m;
  return fits ? shown_m : kSdStep * at_least_m;
}

}  // namespace

void MotionSense::step(const Inputs& inputs, float duty, float dt_s, float missed_s) {
  fault_changed_ = mismatch_changed_ = false;
  if (inputs.known_motion) {
    motion_ = *inputs.known_motion;
    known_position_m_ = motion_.position_m;
    motion_.position_m -= origin_m_;
    position_sd_m_ = 0;
    return;
  }
  if (missed_s > 0) estimator_.step({0, false, duty, std::min(missed_s, kMotorOffS)});
  if (missed_s > kMotorOffS) estimator_.step({0, false, 0, std::min(missed_s - kMotorOffS, kLongestStepS)});
  estimator_.step({inputs.acceleration_counts, inputs.acceleration_is_valid, duty, dt_s});
  fault_changed_ =
      watch_.step(kMS2PerCount * static_cast<float>(inputs.acceleration_counts), inputs.acceleration_is_valid);
  mismatch_changed_ = estimator_.model_mismatch() != mismatch_;
  mismatch_ = estimator_.model_mismatch();
  motion_ = {estimator_.position_m(), estimator_.velocity_m_s(), estimator_.acceleration_m_s2()};
  position_sd_m_ = in_steps(position_sd_m_, estimator_.position_sd_m());
}

void MotionSense::zero_position() {
  estimator_.zero_position();
  origin_m_ = known_position_m_;
  motion_.position_m = position_sd_m_ = 0;
}

void MotionSense::add_to(Crc32& crc) const {
  estimator_.add_to(crc);
  for (const float value : {motion_.position_m, motion_.velocity_m_s, motion_.acceleration_m_s2, position_sd_m_}) {
    crc.add_float(value);
  }
}

}  // namespace robot_fw
