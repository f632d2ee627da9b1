// Maps the fractional PD controller to a discrete transfer function of low order.
//
//   s → ((1 + a)/T) (1 - z^-1)/(1 + a z^-1)            (1)   between Euler (a = 0) and Tustin (a = 1)
//   direct: C of (1) on a uniform grid of the unit circle → inverse FFT → impulse response → Steiglitz-McBride → b, a
//   (2) oustaloup: s^μ ≈ poles and zeros, geometric in [ω_b, ω_h], then Tustin (3) the numerator's direct term is
//   shifted so that G(1) = kp exactly                                            (4)
//
// The paper's source for its direct method was not found; (1), (2) are its usual form. With order 5 at 10 ms nearly all
// the error near the Nyquist frequency is the mapping (1), not the fit; below 30 rad/s, where the loop lives, (3) is as
// good or better. So the paper's "direct is more accurate" holds in phase near Nyquist only.
// Errors: throws std::invalid_argument quoting the bad value. A fit that does not come out stable throws
// std::runtime_error saying what to change.
#pragma once

#include <string>

#include "control/sections.hpp"

namespace control {

enum class DiscretisationMethod { direct, oustaloup };

struct DiscretisationOptions {
  double period_s = 0.01;
  int order = 5;
  DiscretisationMethod method = DiscretisationMethod::direct;
  double a = 0.5;                    // of (1), in [0, 1]; direct only
  double band_low_rad_s = 0.1;       // of (3)
  double band_high_rad_s = 1000;     // of (3)
  int grid_points = 2048;            // of (2), a power of two
  double loop_bandwidth_rad_s = 30;  // where the errors that matter are read
};

// Against the exact C(jω), at logarithmically spaced frequencies.
struct DiscretisationErrors {
  double band_low_rad_s = 0, band_high_rad_s = 0;  // the whole band: up to 0.8 of the Nyquist frequency
  double max_db = 0, max_deg = 0, rms_relative = 0;
  double bandwidth_rad_s = 0;  // and below the loop's bandwidth
  double max_relative_in_bandwidth = 0, max_deg_in_bandwidth = 0;
  double fit_max_relative = 0;  // against (1) itself; 0 for (3), which has no fit
};

struct Discretisation {
  DiscretisationOptions options;
  DiscreteTransferFunction transfer;
  ParallelSections sections;
  double dc_gain = 0;         // after (4): kp
  double dc_gain_before = 0;  // of the fit
  DiscretisationErrors errors;
  bool is_stable = false;
  bool is_minimum_phase = false;
  double largest_pole = 0, largest_zero = 0;  // magnitudes
  double noise_gain = 0;                      // sd of the duty per sd of white noise on the position, open loop
  double float32_rms_duty = 0;                // of the sections, for the error of a 0.1 m step
};

Discretisation discretise(const FopdController& controller, const DiscretisationOptions& options);

struct DiscretisationChoice {
  Discretisation chosen;
  std::string reason;                    // one or two sentences with the numbers that decided
  std::vector<Discretisation> compared;  // everything that was tried
};

// Tries both methods and several a, and takes the least noisy one among those accurate within the loop's bandwidth.
DiscretisationChoice choose_discretisation(const FopdController& controller, double period_s, int order,
                                           double loop_bandwidth_rad_s);

}  // namespace control
