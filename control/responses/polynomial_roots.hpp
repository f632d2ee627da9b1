// Finds the roots of a polynomial: the eigenvalues of its companion matrix.
//
//   Σ c_k z^(n-k) = 0,  k = 0..n,  c_0 ≠ 0                      (1)
//
// Accuracy: about 1e-16 of the largest coefficient; roots that crowd hold as many digits as (1) itself does.
#pragma once

#include <complex>
#include <span>
#include <vector>

namespace control {

// n roots of the n + 1 coefficients of (1).
std::vector<std::complex<double>> polynomial_roots(std::span<const double> coefficients);

}  // namespace control
