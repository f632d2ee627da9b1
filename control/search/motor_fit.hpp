// Fits the motor's first-order lag to recorded duty and propeller rate.
//
//   rate[k+1] = rate[k] + (1 - e^{-dt/Tm}) (km duty[k] - rate[k]),  output error    (1)   [birs2021] (17), (27)
//
// Errors: throws std::invalid_argument quoting the bad value for data that cannot be used.
#pragma once

#include <span>

#include "control/models/plant_models.hpp"

namespace control {

struct MotorFit {
  MotorModel motor;
  double gain_sigma_rad_s = 0;
  double time_constant_sigma_s = 0;
  double sse = 0;
  double fit_percent = 0;
  double residual_sd_rad_s = 0;
};

// duty[k] holds from sample k to sample k + 1; the rate starts at rate_rad_s[0].
MotorFit fit_motor(double dt_s, std::span<const double> duty, std::span<const double> rate_rad_s);

}  // namespace control
