// Frequency response and stability margins of the open loop, plant times controller.
//
//   L(jω) = C(jω) H(jω)/(jω)                      (1)   position loop, [birs2021] (22), (23)
//   L(jω) = C(jω) H(jω)                           (2)   velocity loop
//   arg L = -π/2 + arg C - arg D - ωT             (3)   unwrapped: both arguments are continuous in ω, since D and C
//                                                       stay in one half plane along the imaginary axis; T: dead time
//   phase slope = d arg L/dω                      (4)   0 at the crossover is iso-damping, [birs2021] (26); analytic
//   Ms = sup |1/(1 + L)|,  Mt = sup |L/(1 + L)|   (5)   over all ω, the limits at 0 and ∞ included
//   Σ ±floor((arg L + π)/2π) = 0                  (6)   stable: over the ends of all ranges with |L| > 1, + where one
//                                                       begins, - where it ends; Nyquist's criterion
//
// The frequencies searched are those of loop_scan.hpp.
// Accuracy: crossovers 1e-12 relative; magnitude and phase 1e-10 dB and degrees; held by margins_test.cpp.
// Errors:   throws std::invalid_argument quoting the bad value.
// Differs from the paper: no.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "control/responses/open_loop.hpp"

namespace control {

void check(const OpenLoop& loop);

Complex open_loop_response(const OpenLoop& loop, double omega_rad_s);      // L(jω), principal value
double open_loop_phase_rad(const OpenLoop& loop, double omega_rad_s);      // (3), unwrapped
double open_loop_phase_slope_s(const OpenLoop& loop, double omega_rad_s);  // (4), rad/(rad/s)

struct BodePoint {
  double omega_rad_s = 0;
  double magnitude_db = 0;
  double phase_deg = 0;  // unwrapped
};

// omega_rad_s: positive, any order.
std::vector<BodePoint> bode(const OpenLoop& loop, std::span<const double> omega_rad_s);

// count frequencies from first to last, evenly spaced in the logarithm.
std::vector<double> log_spaced(double first_rad_s, double last_rad_s, int count);

struct Margins {
  std::vector<double> gain_crossovers_rad_s;  // every ω with |L| = 1, ascending
  // Every ω with arg L = -π, ascending; with a dead time also of -3π, -5π, …, those with |L| above 0.1, or the first.
  std::vector<double> phase_crossovers_rad_s;
  // At the crossover with the smallest phase margin; none if |L| never is 1. Where a dead time has turned the L of a
  // stable loop by more than once, from the nearest odd multiple of -π.
  std::optional<double> gain_crossover_rad_s;
  std::optional<double> phase_margin_deg;
  std::optional<double> phase_slope_deg_per_rad_s;
  // The one nearest to 0 dB, negative where the gain must not fall; none if the phase never reaches -180 degrees.
  std::optional<double> gain_margin_db;
  bool is_closed_loop_stable = false;  // by Nyquist's criterion; if not, the other numbers are no margins
  double ms = 0;
  double mt = 0;
  double ms_at_rad_s = 0;  // the end of the searched range if (5) is a limit
  double mt_at_rad_s = 0;
};

Margins margins(const OpenLoop& loop);

}  // namespace control
