// Least squares on filtered impulse responses.
#include "control/discretisation/steiglitz_mcbride.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cassert>
#include <complex>

#include "control/responses/polynomial_roots.hpp"

namespace control {
namespace {

constexpr double kDependent = 1e-11;        // pivots below this share of the largest: columns that depend on each other
constexpr double kReflectedRadius = 0.999;  // for a pole exactly on the unit circle

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

// signal/A
VectorXd filtered(const VectorXd& a, VectorXd signal) {
  for (Index i = 0; i < signal.size(); ++i) {
    for (Index k = 1; k < a.size() && k <= i; ++k) signal(i) -= a(k) * signal(i - k);
  }
  return signal;
}

// Columns: the signal delayed by first..last samples.
MatrixXd delayed(const VectorXd& signal, Index first, Index last) {
  MatrixXd columns = MatrixXd::Zero(signal.size(), last - first + 1);
  for (Index k = first; k <= last; ++k) columns.col(k - first).tail(signal.size() - k) = signal.head(signal.size() - k);
  return columns;
}

// Moves the roots of A inside the unit circle; says whether there were any outside.
bool reflect_poles(VectorXd& a) {
  const Index n = a.size() - 1;
  const std::vector<std::complex<double>> poles = polynomial_roots({a.data(), static_cast<std::size_t>(a.size())});
  if (std::ranges::all_of(poles, [](std::complex<double> pole) { return std::abs(pole) < 1; })) return false;
  Eigen::VectorXcd product = Eigen::VectorXcd::Zero(n + 1);
  product(0) = 1;
  for (std::complex<double> pole : poles) {
    const double radius = std::abs(pole);
    if (radius == 1) pole *= kReflectedRadius;
    if (radius > 1) pole = 1.0 / std::conj(pole);
    for (Index k = n; k >= 1; --k) product(k) -= pole * product(k - 1);
  }
  a = product.real();
  return true;
}

VectorXd impulse(Index length) {
  VectorXd result = VectorXd::Zero(length);
  result(0) = 1;
  return result;
}

VectorXd fitted_numerator(const VectorXd& h, const VectorXd& a) {
  return delayed(filtered(a, impulse(h.size())), 0, a.size() - 1).householderQr().solve(h);
}

// A fit with its output error.
RationalFit measured(const VectorXd& h, const VectorXd& b, const VectorXd& a) {
  const VectorXd error = h - delayed(filtered(a, impulse(h.size())), 0, b.size() - 1) * b;
  return {{b.begin(), b.end()}, {a.begin(), a.end()}, error.norm()};
}

}  // namespace

std::vector<RationalFit> steiglitz_mcbride(std::span<const double> impulse_response, int order, int iterations) {
  assert(order >= 1 && static_cast<std::size_t>(4 * order) <= impulse_response.size());
  const auto length = static_cast<Index>(impulse_response.size());
  const VectorXd h = Eigen::Map<const VectorXd>(impulse_response.data(), length);
  Index n = order;
  VectorXd previous = impulse(n + 1);
  std::vector<RationalFit> fits;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const VectorXd u = filtered(previous, h), v = filtered(previous, impulse(length));
    MatrixXd columns(length, 2 * n + 1);
    columns << -delayed(u, 1, n), delayed(v, 0, n);
    const VectorXd scale = columns.colwise().norm().cwiseMax(1e-300);
    columns = columns * scale.cwiseInverse().asDiagonal();
    Eigen::ColPivHouseholderQR<MatrixXd> qr(columns);
    qr.setThreshold(kDependent);
    if (iteration == 0 && qr.rank() < 2 * n + 1) {
      n = qr.rank() - (n + 1);
      if (n == 0) return {measured(h, h.head(1), impulse(1))};
      previous = impulse(n + 1);
      continue;
    }
    const VectorXd solution = qr.solve(u).cwiseQuotient(scale);
    if (!solution.allFinite()) break;
    VectorXd a(n + 1), b = solution.tail(n + 1);
    a << 1, solution.head(n);
    if (reflect_poles(a)) b = fitted_numerator(h, a);
    if (!a.allFinite() || !b.allFinite()) break;
    fits.push_back(measured(h, b, a));
    previous = a;
  }
  return fits;
}

}  // namespace control
