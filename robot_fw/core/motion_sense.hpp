// The robot's position and velocity: the estimate, or the readings of a perfect sensor.
//
// Missed ticks are estimated as the motor spent them: with its duty for 50 ms, then off, as a board forces it off. The
// standard deviation goes in steps, so that it does not change in every batch: it is 1 to 2 times
// that of the estimator, and at least 0.1 mm.
#pragma once

#include "robot_fw/core/crc32.hpp"
#include "robot_fw/core/estimator.hpp"
#include "robot_fw/core/hardware_io.hpp"
#include "robot_fw/core/sensor_watch.hpp"

namespace robot_fw {

constexpr float kMotorOffS = 0.05F;  // a board forces the motor off after so long without a tick

class MotionSense {
 public:
  // At position 0, see Estimator.
  MotionSense(const EstimatorParameters& parameters, float position_sd_m) : estimator_(parameters, position_sd_m) {}

  // Once per tick: `duty` is what the motor had since the last one, `missed_s` the time since then beyond dt_s.
  void step(const Inputs& inputs, float duty, float dt_s, float missed_s);
  // Sets the position to 0. The motor is off.
  void zero_position();
  // Takes effect in the next tick; is_settled() must hold.
  void set_parameters(const EstimatorParameters& parameters) { estimator_.set_parameters(parameters); }

  bool is_settled() const { return estimator_.is_settled(); }
  // Restores a fault from before a reset: it holds until good readings end it.
  void distrust() { watch_.distrust(); }

  const Motion& motion() const { return motion_; }
  float position_sd_m() const { return position_sd_m_; }  // 0: known
  // Of the accelerometer; whether that is news in this tick.
  SensorFault fault() const { return watch_.fault(); }
  bool fault_changed() const { return fault_changed_; }
  // The model does not explain the motion; whether that is news in this tick.
  bool model_mismatch() const { return mismatch_; }
  bool mismatch_changed() const { return mismatch_changed_; }
  float surprise() const { return estimator_.surprise(); }  // see there

  void add_to(Crc32& crc) const;  // its floats

 private:
  Estimator estimator_;
  SensorWatch watch_{kAccelerometerRules};
  bool fault_changed_ = false;
  bool mismatch_ = false, mismatch_changed_ = false;
  Motion motion_;
  float known_position_m_ = 0;  // as the perfect sensor said
  float origin_m_ = 0;          // of the perfect sensor
  float position_sd_m_ = 0;

  // The BNO055's fusion has ±4 g; with its noise, a second of equal readings is none.
  static constexpr SensorRules kAccelerometerRules{-39.2F, 39.2F, 25, 100, 5};
};

}  // namespace robot_fw
