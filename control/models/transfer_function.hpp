// Evaluates the plant and the fractional PD controller anywhere in the plane cut along the negative real axis.
//
//   D(s) = b1 s^α + b2 s^β + b3                (1)   H = kp/D e^{-sT}: [birs2021] (20), with the dead time
//   C(s) = kp (1 + kd s^μ)                     (2)   [birs2021] (23), (30); duty per m
//
// Arguments are ln s = ln|s| + i arg s, so that no magnitude overflows before it must and the sheet is explicit.
// Errors: check throws std::invalid_argument quoting the bad value; the rest assumes checked arguments.
#pragma once

#include <complex>

#include "control/models/plant_models.hpp"

namespace control {

using Complex = std::complex<double>;

// (2). 0 < mu < 2; kp > 0, kd ≥ 0. The paper's design has mu < 1; 1 is the classical PD.
struct FopdController {
  double kp = 65.0028;
  double kd = 0.0305;
  double mu = 0.6524;
};

constexpr FopdController kPaperController{};  // (30)

void check(const FopdController& controller);

Complex denominator(const FractionalModel& model, Complex log_s);        // (1)
Complex denominator_slope(const FractionalModel& model, Complex log_s);  // dD/ds
Complex velocity_transfer(const FractionalModel& model, Complex s);      // H(s)
Complex controller_transfer(const FopdController& controller, Complex s);

}  // namespace control
