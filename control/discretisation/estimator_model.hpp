// Turns a plant into the model that the robot's estimator uses: first-order sections, stepped in float32 every 10 ms.
//
//   v(t) = v_∞ Σ g_i (1 - e^{-t/τ_i})                                     (1)   step of duty 1; v_∞ = kp/b3
//   y_i → y_i + σ(T/τ_i) (u - y_i),  σ(x) = 12x/(12 + 6x + x²) ≈ 1 - e^{-x}     (2)   as robot_fw/core/estimator does
//   it minimise Σ_n |v(nT)/v_∞ - Σ g_i (1 - (1 - σ_i)^n)|^p over g_i, ln τ_i       (3)   p = 2, 4, … 64: nearly the
//                                                                          largest
//
// (3) is searched by Levenberg and Marquardt from several starts, with as few sections as do and at most four. The
// times are dense early and spaced evenly in ln t later, up to 60 s, with the final velocity beside them, so that the
// model is right for as long as the motor runs. T = 10 ms → kEstimatorPeriodS. The gains, summed, cancel: they are kept
// within ±10 v_∞, so that float32 costs a fit error of 1e-5 at most, and within what the robot's parameters may be.
// The values that are returned are float32. Their fit error is the largest over all times from 10 ms to 60 s, also
// between the ticks: (2) in float32 at the ticks that are compared, and with (1 - σ_i)^(t/T) in every peak between.
//
// Reach:    sections have real poles. Plants that overshoot by a percent or more cannot be met by four of them:
//           is_met is false then, and `reason` says so. With b1, b2 of (29) halved to doubled, orders
//           1.4 to 1.95 and 0.6 to 0.98, three plants in five are met (docs/control.md).
// Accuracy: fit error 1e-5 of |v_∞|, held by estimator_model_test.cpp.
// Errors:   throws std::invalid_argument as check() does. No fit that is good enough is a result.
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "control/models/plant_models.hpp"

namespace control {

constexpr std::size_t kEstimatorSections = 4;
constexpr double kEstimatorPeriodS = 0.01;
constexpr double kLargestFitError = 0.005;

struct EstimatorSections {
  std::array<float, kEstimatorSections> gain_m_s{};  // v_∞ g_i, per duty; unused sections: 0
  std::array<float, kEstimatorSections> time_constant_s{};
};

struct EstimatorModel {
  EstimatorSections sections;
  double fit_error = 0;  // the largest |error| of the step response from 10 ms to 60 s, relative to |v_∞|
  bool is_met = false;   // the fit error is at most kLargestFitError: the robot can use it
  std::string reason;    // if not: why, in words
};

EstimatorModel estimator_model(const FractionalModel& plant);

// The largest error from 10 ms to 60 s, relative to the plant's final velocity.
double fit_error(const EstimatorSections& sections, const FractionalModel& plant);

}  // namespace control
