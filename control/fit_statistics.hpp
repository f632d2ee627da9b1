// What residuals and a Jacobian say about a fit.
//
//   covariance = (JᵀJ)⁻¹, J in units of the residual's sd                     (1)   Cramér-Rao
//   AIC = Σ_channels n ln(sse/n) + 2 k                                        (2)   Gaussian; k: free parameters
//   AIC = Σ_channels 2 n ln(Σ|r|/n) + 2 k                                     (3)   Laplacian, for the absolute error
//   Q = n (n + 2) Σ_{j≤h} ρ_j²/(n - j),  p = P(χ²_h > Q)                      (4)   Ljung-Box, h even and ≤ 20
// Errors: none thrown. A parameter about which J says nothing has no sigma.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace control {

struct Uncertainty {
  std::vector<std::optional<double>> one_sigma;  // none: not determined at all
  Eigen::MatrixXd correlation;
};

Uncertainty uncertainty(const Eigen::MatrixXd& jacobian);  // (1)

double whiteness_p_value(const Eigen::VectorXd& residual);  // (4)

}  // namespace control
