// The companion matrix.
#include "control/responses/polynomial_roots.hpp"

#include <Eigen/Eigenvalues>

namespace control {

std::vector<std::complex<double>> polynomial_roots(std::span<const double> coefficients) {
  const auto n = static_cast<Eigen::Index>(coefficients.size()) - 1;
  if (n <= 0) return {};
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    companion(0, k) = -coefficients[static_cast<std::size_t>(k) + 1] / coefficients[0];
  }
  for (Eigen::Index k = 1; k < n; ++k) companion(k, k - 1) = 1;
  const Eigen::VectorXcd values = companion.eigenvalues();
  return {values.begin(), values.end()};
}

}  // namespace control
