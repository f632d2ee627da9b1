// Frequency response and stability margins of the open loop, plant times controller.
//
//   L(jω) = C(jω) H(jω)/(jω)                 (1)   position loop, [birs2021] (22), (23); the velocity loop has no
//   1/(jω) arg L = -π/2 + arg C - arg D             (2)   unwrapped: both arguments are continuous in ω, since D and C
//   stay
//                                                  in one half plane along the imaginary axis
//   phase slope = d arg L/dω                 (3)   0 at the crossover is iso-damping, [birs2021] (26)
//   Ms = max |1/(1 + L)|,  Mt = max |L/(1 + L)|   (4)
//
// Errors: throws std::invalid_argument quoting the bad value.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "control/transfer_function.hpp"

namespace control {

struct OpenLoop {
  FractionalModel plant;
  FopdController controller;
  bool is_velocity_loop = false;
};

void check(const OpenLoop& loop);

Complex open_loop_response(const OpenLoop& loop, double omega_rad_s);      // L(jω), principal value
double open_loop_phase_rad(const OpenLoop& loop, double omega_rad_s);      // (2), unwrapped
double open_loop_phase_slope_s(const OpenLoop& loop, double omega_rad_s);  // (3), rad/(rad/s)

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
  std::vector<double> gain_crossovers_rad_s;   // every ω with |L| = 1, ascending
  std::vector<double> phase_crossovers_rad_s;  // every ω with arg L = -π - 2πk, ascending
  // At the crossover with the smallest phase margin; none if |L| never is 1.
  std::optional<double> gain_crossover_rad_s;
  std::optional<double> phase_margin_deg;
  std::optional<double> phase_slope_deg_per_rad_s;
  std::optional<double> gain_margin_db;  // the smallest; none if the phase never reaches -180 degrees: infinite
  double ms = 0;
  double mt = 0;
  double ms_at_rad_s = 0;
  double mt_at_rad_s = 0;
};

Margins margins(const OpenLoop& loop);

}  // namespace control
