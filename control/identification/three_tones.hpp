// Measures the plant at one frequency without a model of it: modulus, phase and phase slope from duty and position, of
// a record in which three tones move the robot.
//
//   ω_1, ω_2, ω_3 = 0.7, 1, 1.4 times ω_gc                                      (1)   all are whole multiples of
//   ω_gc/10 u_k, a_k ≈ c0 + c1 t + c2 t² + Σ_i Re[U_i, A_i e^{jω_i t}]                  (2)   least squares, whole
//   periods of ω_gc/10 P(jω) = A e^{jωL} / (-ω² Z(ω) U),  Z = (1 - e^{-jωT})/(jωT)                 (3)   position per
//   duty; the duty is held d arg P/d ln ω at ω_2: of the parabola through the three phases over ln ω   (4) E = A' -
//   (A/U) U' at the two lines of the window on either side of a tone   (5)   what the duty does not explain sd of ln|P|
//   and of arg P = √(mean |E|²/2) / |A|                             (6) L → sensor_lag_s, T → dt_s
//
// The acceleration is measured; a position that the robot estimates contains a model already, and is not used. Nothing
// has to be known of the loop that the tones come through: (3) is of the duty and of what follows from it. The readings
// are recovered from what the robot has recorded (control/sensor/sensor_readings). The constant and the drift of (2)
// are the sensor's bias.
// A larger distance of the tones would make (4) more exact against noise and less so against the curvature of the
// phase; at ±10 % noise rules. Accuracy: in ten fluids with the default sensor, 60 s: see three_tones_test.cpp. Differs
// from the paper: it takes (24) to (26) from a model. The measured data are those of the forced oscillation method of
// De Keyser, Muresan and Ionescu (2016), which takes one tone and the derivative of its response. Errors: throws
// std::invalid_argument quoting the bad value; what the record does not show is a refusal in words.
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
