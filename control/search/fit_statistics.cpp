// Singular values of the scaled Jacobian, and sums over autocorrelations.
#include "control/search/fit_statistics.hpp"

#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>

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
  if (!std::isfinite(power)) return 0;
  if (power == 0) return 1;
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

double absolute_error_scale(const Eigen::VectorXd& residual, int free_parameters) {
  constexpr double kZ = 1.96;
  std::vector<double> size(static_cast<std::size_t>(residual.size()));
  for (std::size_t k = 0; k < size.size(); ++k) size[k] = std::abs(residual[static_cast<Index>(k)]);
  std::ranges::sort(size);
  const auto zeros = std::min(size.size() / 2, static_cast<std::size_t>(std::max(0, free_parameters)));
  const double n = static_cast<double>(size.size() - zeros);
  const double h = std::cbrt(kZ * kZ * 1.5 / (2 * std::numbers::pi) / n);  // (6)
  const double share = std::min(2 * h, 0.9);
  const double quantile = size[zeros + static_cast<std::size_t>(share * (n - 1))];
  return quantile / share * std::sqrt(static_cast<double>(size.size()) / n);  // (5)
}

double samples_per_independent_one(const Eigen::VectorXd& residual) {
  constexpr Index kMostLags = 1000;
  const Index n = residual.size(), lags = std::min(kMostLags, n / 4);
  const Eigen::VectorXd centred = residual.array() - residual.mean();
  const double power = centred.squaredNorm();
  double sum = 1;
  for (Index lag = 1; lag <= lags && power > 0; ++lag) {
    const double rho = centred.head(n - lag).dot(centred.tail(n - lag)) / power;
    if (!(rho > 0)) break;
    sum += 2 * rho;
  }
  return sum;
}

double drift_factor(const Eigen::VectorXd& residual, Index values_per_mean) {
  constexpr Index kFewestMeans = 10;
  constexpr double kLeast = 1.3, kSigmas = 3.1;
  double factor = 1;
  for (Index length = std::max<Index>(2, values_per_mean); residual.size() / length >= kFewestMeans; length *= 2) {
    const Index count = residual.size() / length;
    const Eigen::Map<const Eigen::MatrixXd> pieces(residual.data(), length, count);
    const double mean = pieces.mean(), variance = (pieces.array() - mean).square().mean();
    const double freedom = static_cast<double>(count - 1), spread = 2 / (9 * freedom);
    const double of_means = (pieces.colwise().mean().array() - mean).square().sum() / freedom;
    const double ratio = static_cast<double>(length) * of_means / std::max(1e-300, variance);  // (8)
    const double by_chance = std::pow(1 - spread + kSigmas * std::sqrt(spread), 3);            // Wilson and Hilferty
    if (ratio > by_chance && ratio > kLeast * kLeast) factor = std::max(factor, std::sqrt(ratio));
  }
  return factor;
}

Index values_in_2_s(Index values, double duration_s) {
  return static_cast<Index>(std::lround(2 / duration_s * static_cast<double>(values)));
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace control
