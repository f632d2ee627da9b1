// What a BNO055 makes of the acceleration: bandwidth, noise, a bias that wanders, quantisation, a clock of its own.
//
//   reading = round((f + bias + noise) / 0.01 m/s²)                                    (1)   100 LSB per m/s²
//   bias = offset - mean of 2 s at rest + wander + drift · t                            (2)
//   wander' = -wander/τ + white noise, sd σ                                             (3)
//   f' = 2π B (a - f)                                                                   (4)   B: bandwidth
//   a = acceleration along the tube · cosine of the angle of its axis                   (5)
//
// BNO055 data sheet: output unit 0.01 m/s², fusion at 100 Hz with a bandwidth of 62.5 Hz. Noise density 150 µg/√Hz over
// that bandwidth (0.0116 m/s² a sample), offset ±20 mg, bias instability 0.05 mg with τ = 100 s and drift 10 µg/s are
// assumed values. (2): the sensor's fusion removes the offset while it lies at rest before the motion; what remains is
// the mean of 2 s of noise. The drift takes either direction.
// The sensor samples by its own clock, off by up to 0.5 %, at a phase of its own: a tick reads the latest sample, which
// is up to 10 ms old, now and then the one it read before, and now and then one is skipped. A read can fail.
// Shapes:   one accelerate() for each tick, then one read().
// Errors:   throws std::invalid_argument quoting the bad value.
#pragma once

#include <cstdint>

#include "sim_robot/world/noise.hpp"
#include "sim_robot/world/sensor_fault.hpp"

namespace sim_robot {

struct ImuParameters {
  double noise_m_s2_rthz = 0.0014673;      // noise density, per √Hz
  double bandwidth_hz = 62.5;              // B
  double offset_m_s2 = 0.196;              // the largest, 20 mg
  double calibration_s = 2;                // at rest
  double wander_m_s2 = 0.00049;            // σ, 0.05 mg
  double wander_time_s = 100;              // τ
  double drift_m_s3 = 0.000098;            // 10 µg/s
  double clock_error = 0.005;              // the largest, relative; [0, 0.1]
  double missed_read_probability = 0.001;  // of each read
  double axis_cosine = 1;                  // of its axis to forwards: -1 the wrong way round, 0 across the tube
};

void check(const ImuParameters& parameters);

struct ImuReading {
  std::int16_t counts = 0;  // of 0.01 m/s²; the latest sample also when the read failed
  bool is_valid = false;
};

class Imu {
 public:
  static constexpr double kCountsPerMS2 = 100;

  Imu(const ImuParameters& parameters, std::uint64_t seed);

  // Time passes up to the next tick, at whose end the acceleration is `acceleration_m_s2`. In between it is a parabola
  // with this mean, so that the readings add up to the velocity, or a straight line.
  void accelerate(double acceleration_m_s2, double mean_m_s2);
  void accelerate(double acceleration_m_s2) {
    accelerate(acceleration_m_s2, (acceleration_m_s2_ + acceleration_m_s2) / 2);
  }
  ImuReading read();

  void set_fault(const SensorFault& fault) { fault_ = fault; }

  double bias_m_s2() const { return residual_m_s2_ + wander_m_s2_ + drift_m_s2_; }  // the truth, without a fault

 private:
  std::int16_t sample(double acceleration_m_s2);
  double fault_m_s2();

  Noise noise_;
  double noise_m_s2_;                        // sd of a sample
  double wander_decay_, wander_step_m_s2_;   // of (3), in a tick
  double filter_decay_, filter_late_share_;  // of (4): e^{-x} and 1 - (1 - e^{-x})/x, x = 2πB dt
  double filter_bend_share_;                 // and 6 (x - 2 + (x + 2) e^{-x})/x²
  double missed_read_probability_, axis_cosine_;
  double sample_period_s_, drift_m_s3_;
  double residual_m_s2_ = 0, wander_m_s2_ = 0, drift_m_s2_ = 0;
  double until_sample_s_;
  double acceleration_m_s2_ = 0;  // along the tube at the last tick
  double filtered_m_s2_ = 0;      // f, then
  std::int16_t counts_ = 0;
  SensorFault fault_;
};

}  // namespace sim_robot
