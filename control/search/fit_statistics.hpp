// What residuals and a Jacobian say about a fit.
//
//   covariance = (JᵀJ)⁻¹, J in units of the residual's sd                     (1)   Cramér-Rao
//   AIC = Σ_channels n ln(sse/n) + 2 k                                        (2)   Gaussian; k: free parameters
//   AIC = Σ_channels 2 n ln(Σ|r|/n) + 2 k                                     (3)   Laplacian, for the absolute error
//   Q = n (n + 2) Σ_{j≤h} ρ_j²/(n - j),  p = P(χ²_h > Q)                      (4)   Ljung-Box, h even and ≤ 20
//   τ = 1/(2 f(0)) ≈ |r|_(2h)/(2h), |r|_(q): the q-quantile of the sizes                (5)   [koenker-bassett]
//   h = n^(-1/3) z^(2/3) (1.5 φ(0)²)^(1/3), z = 1.96                                    (6)   [hall-sheather]
//   n_effective = n/(1 + 2 Σ ρ_j), up to the first ρ_j < 0                              (7)   of a mean
// (5) takes the residuals to be symmetrical and leaves out those that the parameters bring to zero.
// R = m var(means of m values)/var,  √R if R > χ²_(N-1)/(N-1) at 3.1 sigma                (8)   N means; 1 for white
// (8) finds a slow drift under noise, which (4) is blind to: at short lags its share of the squares is small.
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

double whiteness_p_value(const Eigen::VectorXd& residual);  // (4); 1 if all are equal, 0 if one is no number

// (5): what takes the place of the sd in (1) for the absolute error.
double absolute_error_scale(const Eigen::VectorXd& residual, int free_parameters);

double samples_per_independent_one(const Eigen::VectorXd& residual);  // n/n_effective of (7), at least 1

// √R of (8), the largest of means over this many values, twice, four times and so on, while there are ten means: by how
// much sigmas of what is slow may be too small. 1 where chance explains R, or √R is below 1.3.
double drift_factor(const Eigen::VectorXd& residual, Eigen::Index values_per_mean);
Eigen::Index values_in_2_s(Eigen::Index values, double duration_s);  // of as many, evenly over the duration

double median(std::vector<double> values);

}  // namespace control
