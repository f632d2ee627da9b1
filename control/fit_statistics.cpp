// Singular values of the scaled Jacobian, and sums over autocorrelations.
#include "control/fit_statistics.hpp"

#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace control {

using Eigen::Index;

Uncertainty uncertainty(const Eigen::MatrixXd& jacobian) {
  constexpr double kSmallestRatio = 1e-10, kShareOfDirection = 1e-3;
  const Index count = jacobian.cols();
  const Eigen::VectorXd norm = jacobian.colwise().norm().transpose();
  const Eigen::VectorXd scale = norm.cwiseMax(1e-300).cwiseInverse();
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(jacobian * scale.asDiagonal());
  const Eigen::MatrixXd triangle = qr.matrixQR().topRows(count).triangularView<Eigen::Upper>();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(triangle, Eigen::ComputeFullV);
  const auto& value = svd.singularValues();

  std::vector<bool> is_determined(static_cast<std::size_t>(count), true);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(count, count);
  for (Index i = 0; i < count; ++i) {
    const Eigen::VectorXd direction = svd.matrixV().col(i);
    if (value[i] > kSmallestRatio * value[0]) {
      covariance += direction * direction.transpose() / (value[i] * value[i]);
    } else {
      for (Index j = 0; j < count; ++j) {
        if (std::abs(direction[j]) > kShareOfDirection) is_determined[static_cast<std::size_t>(j)] = false;
      }
    }
  }
  const Eigen::VectorXd sigma = covariance.diagonal().cwiseSqrt();
  Uncertainty result{{}, Eigen::MatrixXd::Identity(count, count)};
  for (Index i = 0; i < count; ++i) {
    const bool has_sigma = is_determined[static_cast<std::size_t>(i)];
    result.one_sigma.push_back(has_sigma ? std::optional(sigma[i] * scale[i]) : std::nullopt);
    for (Index j = 0; j < i; ++j) {
      const bool both = has_sigma && is_determined[static_cast<std::size_t>(j)];
      result.correlation(i, j) = result.correlation(j, i) = both ? covariance(i, j) / (sigma[i] * sigma[j]) : 0;
    }
  }
  return result;
}

// The tail of χ² with an even number of degrees of freedom is a finite sum.
double whiteness_p_value(const Eigen::VectorXd& residual) {
  const Index n = residual.size(), lags = std::max<Index>(2, std::min<Index>(20, n / 5 / 2 * 2));
  const Eigen::VectorXd centred = residual.array() - residual.mean();
  const double power = centred.squaredNorm();
  if (!(power > 0)) return 1;
  double q = 0;
  for (Index lag = 1; lag <= lags; ++lag) {
    const double rho = centred.head(n - lag).dot(centred.tail(n - lag)) / power;
    q += rho * rho / static_cast<double>(n - lag);
  }
  q *= static_cast<double>(n) * static_cast<double>(n + 2);
  double term = std::exp(-q / 2), sum = 0;
  for (Index k = 0; k < lags / 2; ++k) {
    sum += term;
    term *= q / 2 / static_cast<double>(k + 1);
  }
  return std::min(sum, 1.0);
}

}  // namespace control
