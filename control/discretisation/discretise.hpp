// Maps the fractional PD controller to a discrete transfer function of low order.
//
//   s → ((1 + a)/T) (1 - z^-1)/(1 + a z^-1)            (1)   between Euler (a = 0) and Tustin (a = 1)
//   direct: C of (1) on a uniform grid of M points of the unit circle → inverse FFT → the first M/2 samples of the
//   impulse response → Steiglitz-McBride → b, a        (2)   of the iterates, the one that gives the response best
//   oustaloup: s^μ ≈ poles and zeros, geometric in [ω_b, ω_h], then Tustin               (3)
//   the numerator's direct term is shifted so that G(1) = kp exactly                     (4)
//
// The paper's source for its direct method was not found; (1), (2) are its usual form. With order 5 at 10 ms nearly all
// the error near the Nyquist frequency is the mapping (1), not the fit; below 30 rad/s, where the loop lives, (3) is as
// good or better. So the paper's "direct is more accurate" holds in phase near Nyquist only.
// Accuracy: reproduces the reference coefficients for a = 0, 0.5, 0.9 and for (3) to 1e-9 relative, held by
//           discretise_test.cpp.
// The sections are the result. The same controller as coefficients of 1/z loses digits where poles crowd near 1: with
// (30) and (3) beyond order 8 at 10 ms, beyond order 4 at 1 ms; later with the direct method. So the coefficients are
// formed in extended precision, rounded, and compared with the sections: if they are more than 1e-6 off anywhere, there
// is no `transfer`, and transfer_note says so.
//
// Errors: throws std::invalid_argument quoting the bad value. A fit that does not come out stable, or is more than 25 %
// off its own target (1) somewhere below 0.8 of the Nyquist frequency, throws std::runtime_error, which names what was
// tried in its place and found to work.
// Controllers that are exactly rational (mu = 1, kd = 0) get as many sections as they need, which may be fewer than
// `order`.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "control/discretisation/discretisation_errors.hpp"
#include "control/responses/sections.hpp"

namespace control {

enum class DiscretisationMethod { direct, oustaloup };

inline constexpr int kLargestOrder = 10;

struct DiscretisationOptions {
  double period_s = 0.01;
  int order = 5;  // 1 to kLargestOrder
  DiscretisationMethod method = DiscretisationMethod::direct;
  double a = 0.5;                    // of (1), in [0, 1]; direct only
  double band_low_rad_s = 0.1;       // of (3)
  double band_high_rad_s = 1000;     // of (3)
  int grid_points = 2048;            // of (2), a power of two
  double loop_bandwidth_rad_s = 30;  // where the errors that matter are read
};

struct Discretisation {
  DiscretisationOptions options;
  ParallelSections sections;
  std::optional<DiscreteTransferFunction> transfer;  // none if its coefficients cannot hold the sections
  double transfer_max_relative = 0;                  // |transfer/sections - 1| at DC and over the band of errors
  std::string transfer_note;                         // why there is no transfer; else empty
  double dc_gain = 0;                                // after (4): kp
  double dc_gain_before = 0;                         // of the fit
  DiscretisationErrors errors;
  bool is_stable = false;
  bool is_minimum_phase = false;
  double largest_pole = 0, largest_zero = 0;  // magnitudes
  // sd of the unclamped duty per sd of white noise on the position, 1/m, of the controller alone: the root of Σ h². In
  // the closed loop the plant filters a little of it: RobustnessTable::duty_sd_per_noise_sd.
  double noise_gain = 0;
  // RMS difference of the sections in float32, on the error of a 0.1 m step of the non-Newtonian plant at duty [-1, 1].
  double float32_rms_duty = 0;
};

Discretisation discretise(const FopdController& controller, const DiscretisationOptions& options);

struct RefusedDiscretisation {
  std::string name;    // e.g. "direct method with a = 0.9"
  std::string reason;  // e.g. "fits only to 67 %"
};

struct DiscretisationChoice {
  Discretisation chosen;
  std::string reason;                          // one or two sentences with the numbers that decided
  std::vector<Discretisation> compared;        // what was tried and came out stable
  std::vector<RefusedDiscretisation> refused;  // what was tried and did not
};

// Tries the direct method with a = 0, 0.25, 0.5, 0.8, 0.9, 1 and Oustaloup's. Of those within 1 % and 0.6 degrees of
// the exact controller below the loop's bandwidth it takes the one with the least noise gain; if there is none, the
// most accurate there. Throws std::runtime_error if nothing comes out stable.
DiscretisationChoice choose_discretisation(const FopdController& controller, double period_s, int order,
                                           double loop_bandwidth_rad_s);

}  // namespace control
