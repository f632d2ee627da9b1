// Measures the plant at one frequency without a model of it: modulus, phase and phase slope of the position per duty,
// from a record in which three tones move the robot.
//
//   ω_1, ω_2, ω_3 = 0.7, 1, 1.4 times ω_gc                                (1)   whole multiples of ω_gc/10
//   u_k, a_k ≈ c0 + c1 t + c2 t² + Σ_i Re[U_i, A_i e^{jω_i t}]            (2)   least squares, whole periods of ω_gc/10
//   P(jω) = A e^{jωL} / (-ω² Z(ω) U),  Z = (1 - e^{-jωT})/(jωT)           (3)   position per duty, which is held
//   d arg P/d ln ω at ω_2: of the parabola through the phases over ln ω   (4)
//   E = A' - (A/U) U' at two lines of the window on each side of a tone   (5)   what the duty does not explain
//   sd of ln|P| and of arg P = √(mean |E|²/2) / |A|                       (6)
//   L → sensor_lag_s, T → dt_s
//
// The acceleration is measured; a position that the robot estimates contains a model already, and is not used. Nothing
// has to be known of the loop that the tones come through: (3) is of the duty and of what follows from it. The readings
// are recovered from what the robot has recorded (control/sensor/sensor_readings). Constant and drift of (2) are the
// sensor's bias. Tones that are nearer (±10 %) leave the slope to the noise, tones that are farther to the curvature.
//
// Accuracy: ten fluids with the default sensor, tones of 0.25 of duty at 4 rad/s, 63 s: modulus within 1.4 %, phase
//           0.3°, slope 4.3 % of R; three_tones_test.cpp holds 2 %, 2° and 10 % in 8 of 10. In a fluid that answers at
//           once (α near 1.4) samples of the acceleration miss a part of what the velocity gains: 1.4 % of the modulus
//           behind the sensor's low pass, 7 % without one.
// Differs from the paper: it tunes to a model. [deKeyser2016] needs the same three numbers, from one tone and the
//           derivative of its response.
// Errors:   throws std::invalid_argument quoting the bad value; what the record does not show is a refusal in words.
#pragma once

#include <array>
#include <span>
#include <string>

namespace control {

// Of a BNO055 that is read at 100 Hz: its low pass of 62.5 Hz, and half a period, which a reading is old in the mean.
inline constexpr double kReadingLagS = 0.0025465 + 0.005;

std::array<double, 3> three_tones_rad_s(double crossover_rad_s);  // (1)
double tone_window_s(double crossover_rad_s);                     // a period of ω_gc/10: the least that is measured

// As a robot records it: duty[k] holds from sample k to sample k + 1.
struct ToneRecord {
  std::span<const double> duty;
  std::span<const double> acceleration_m_s2;
  double dt_s = 0.01;
  double from_s = 0;  // when the beginning of the tones has died away
  double sensor_lag_s = kReadingLagS;
};

struct MeasuredPoint {
  double omega_rad_s = 0;
  double modulus = 0;       // |P|, m per duty
  double phase_rad = 0;     // in (-2π, 0] at the crossover, the others next to it
  double sigma = 0;         // of ln|P|, and of the phase in rad
  double duty = 0;          // amplitude of the tone, |U|
  double acceleration = 0;  // |A|, m/s²
};

struct MeasuredPlant {
  std::array<MeasuredPoint, 3> points;
  double phase_fall = 0;  // R: -(4), rad per unit of ln ω
  double phase_fall_sigma = 0;
  double used_s = 0;    // of the record
  std::string refusal;  // why nothing was measured; empty: it was

  const MeasuredPoint& at_crossover() const { return points[1]; }
};

MeasuredPlant measure_three_tones(const ToneRecord& record, double crossover_rad_s);

}  // namespace control
