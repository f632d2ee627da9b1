// Responses of velocity and position in time: to a step, at any time, and to any sampled duty.
//
//   v(t) = L⁻¹[H(s)/s](t),  x(t) = L⁻¹[H(s)/s²](t)      (1)   step of duty 1 at t = 0, from rest
//   by Talbot's contour in the form of Weideman, s(φ) = (N/t)(0.5017 φ cot(0.6407 φ) - 0.6122 + 0.2645 iφ)   (2)
//   u(t - T) in place of u(t)                             (3)   with a dead time T of the model
//
// A pole pair that the contour for a long t would leave outside is taken off H first and added as an exponential, so
// that lightly damped models are right at all times too. A sampled duty advances the exponentials of modal_form.hpp.
// Shapes:   one value per time.
// Accuracy: 1e-10 relative from the first microsecond to a day and more; where a velocity swings through zero or the
//           duty changes sign, 1e-10 of the largest value so far. Held by time_response_test.cpp against the reference
//           responses, closed forms, the Mittag-Leffler and power series. A sampled position also errs by 1e-15 of
//           kp/b3 ∫|u| dt, which counts for a model of hours in its first milliseconds.
// Errors:   throws std::invalid_argument quoting the bad value.
#pragma once

#include <span>
#include <vector>

#include "control/models/plant_models.hpp"

namespace control {

struct TimeResponse {
  std::vector<double> velocity_m_s;
  std::vector<double> position_m;
};

// The response at each of time_s (finite, ≥ 0, any order) to a step of duty at t = 0.
TimeResponse step_response(const FractionalModel& model, double duty, std::span<const double> time_s);

// duty[k] holds from time_s[k] to time_s[k + 1]; times ascend strictly, the spacing may vary. From rest at time_s[0].
TimeResponse sampled_response(const FractionalModel& model, std::span<const double> time_s,
                              std::span<const double> duty);

}  // namespace control
