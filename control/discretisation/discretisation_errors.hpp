// Measures the error of a discrete controller against its fractional one, in magnitude and phase.
//
//   ε(ω) = G(e^{jωT})/C(jω) - 1 at 200 logarithmically spaced ω up to 0.8 of the Nyquist frequency      (1)
//   generating function  C_a(z) = C(s),  s = ((1 + a)/T) (1 - z^-1)/(1 + a z^-1)                        (2)
//
// With (2) in place of C(jω) what is left is the error of the fit alone.
#pragma once

#include <vector>

#include "control/responses/sections.hpp"

namespace control {

// Against the exact C(jω), at logarithmically spaced frequencies.
struct DiscretisationErrors {
  double band_low_rad_s = 0, band_high_rad_s = 0;  // the whole band: up to 0.8 of the Nyquist frequency
  double max_db = 0, max_deg = 0, rms_relative = 0;
  double bandwidth_rad_s = 0;  // and below the loop's bandwidth, or the end of the whole band if that is lower
  double max_relative_in_bandwidth = 0, max_deg_in_bandwidth = 0;
  double fit_max_relative = 0;  // of the fit before its DC gain is corrected, against (2); 0 where there is no fit
};

// 0.1 rad/s, or 1/300 of the bandwidth if that is lower, to 0.8 of the Nyquist frequency.
std::vector<double> error_frequencies(double period_s, double loop_bandwidth_rad_s);

DiscretisationErrors measure_errors(const ParallelSections& sections, double period_s, const FopdController& controller,
                                    double loop_bandwidth_rad_s);

Complex generating_function(const FopdController& controller, double a, double period_s, Complex z);  // (2)

// max |G/C_a - 1| over these frequencies.
double max_fit_error(const ParallelSections& sections, double period_s, const FopdController& controller, double a,
                     const std::vector<double>& omega_rad_s);

}  // namespace control
