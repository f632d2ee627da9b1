// Fits a rational function of low order to an impulse response: Steiglitz and McBride's iteration.
//
//   minimise ‖(A(z)/A'(z)) h - B(z)/A'(z)‖²  over A (a_0 = 1) and B, with A' of the iteration before, first A' = 1 (1)
//
// Each iteration is a linear least-squares problem. It need not converge, and its fixed point need not be where
// ‖h - B/A‖ is least: often the second or third iterate is better. So every iterate is handed back with that error.
// A pole that comes out on or outside the unit circle is reflected to 1/p*, and B is fitted again to the new A.
// Where h is exactly rational of a lower order, the columns of (1) depend on each other; the order is then lowered.
// Shapes:   numerator and denominator have the same length, at most order + 1; denominator[0] = 1.
// Errors:   an iteration that yields no finite coefficients ends the sequence. Asserts 1 ≤ order, 4 order ≤ length of
// h.
#pragma once

#include <span>
#include <vector>

namespace control {

struct RationalFit {
  std::vector<double> numerator;    // b, ascending powers of 1/z
  std::vector<double> denominator;  // a
  double output_error = 0;          // ‖h - B/A‖
};

std::vector<RationalFit> steiglitz_mcbride(std::span<const double> impulse_response, int order, int iterations);

}  // namespace control
