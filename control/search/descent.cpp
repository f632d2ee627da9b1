// Eigen's solver, stopped by the limit and by numbers that are not finite.
#include "control/search/descent.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unsupported/Eigen/NonLinearOptimization>
#include <utility>
#include <vector>

namespace control {
namespace {

using Eigen::Index;

constexpr std::ptrdiff_t kIdleIterations = 10;
constexpr double kIdleGain = 2e-3;       // a step of one sigma changes the cost by 1, in these units
constexpr double kAgreementGain = 0.04;  // a fifth of a sigma

// What the solver calls; negative: it stops.
struct Functor {
  using Scalar = double;
  const SquaresToMinimise& squares;
  SearchLimit& limit;
  bool is_not_finite = false;

  int operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual) const {
    if (limit.is_reached()) return -1;
    residual.setConstant(1e100);  // refused by the solver
    if (!x.allFinite() || std::abs(x[0]) > 700) return 0;
    if (!squares.residuals(x, residual)) return -1;
    if (!residual.allFinite()) residual.setConstant(1e100);
    return 0;
  }

  int df(const Eigen::VectorXd& x, Eigen::MatrixXd& slopes) {
    if (limit.is_reached()) return -1;
    if (!squares.slopes(x, slopes)) return -1;
    is_not_finite = !slopes.allFinite();
    return is_not_finite ? -1 : 0;
  }

  Index values() const { return squares.values; }
};

// What lies at a bound is infinitely far away in coordinates without bounds, and is approached for ever.
bool is_idle(const std::vector<double>& costs, Index values) {
  if (std::ssize(costs) <= kIdleIterations) return false;
  const double now = costs.back(), before = costs[costs.size() - 1 - kIdleIterations];
  return (before - now) * static_cast<double>(values) < kIdleGain * now;
}

bool is_at(const KnownMinimum& known, const Eigen::VectorXd& x, double cost) {
  return std::abs(cost - known.cost) <= KnownMinimum::kAgreement * known.cost &&
         (x - known.x).cwiseAbs().maxCoeff() <= KnownMinimum::kNear;
}

}  // namespace

bool costs_agree(double cost, double best, double values) {
  return cost <= best * (1 + std::max(KnownMinimum::kAgreement, kAgreementGain / values));
}

Descended descend(const SquaresToMinimise& squares, Eigen::VectorXd x, int iteration_limit, Progress progress,
                  SearchLimit& limit, const KnownMinimum* known) {
  using Status = Eigen::LevenbergMarquardtSpace::Status;
  Functor functor{squares, limit};
  Eigen::LevenbergMarquardt<Functor> solver(functor);
  solver.parameters.ftol = 1e-10;
  solver.parameters.xtol = 1e-11;
  solver.parameters.maxfev = 20 * (iteration_limit + 1);
  solver.useExternalScaling = true;  // the coordinates are of order 1, and their scale must not follow the valley
  solver.diag.setOnes(x.size());
  solver.parameters.factor = 1;
  Descended found{false, x, SearchEnd::converged, progress.iteration, std::numeric_limits<double>::infinity()};
  Status status = solver.minimizeInit(x);
  if (status == Status::UserAsked) {
    found.end = limit.end().value_or(SearchEnd::not_finite);
    return found;
  }
  found.has_begun = true;
  std::vector<double> costs;
  for (int i = 0; status == Status::NotStarted || status == Status::Running; ++i) {
    if (i >= iteration_limit) {
      found.end = SearchEnd::iteration_limit;
      break;
    }
    status = solver.minimizeOneStep(x);
    if (status == Status::UserAsked && limit.end()) break;
    found.iterations = ++progress.iteration;
    progress.sse = squares.sse(solver.fvec);
    limit.report(progress);
    costs.push_back(solver.fvec.squaredNorm());
    if (is_idle(costs, squares.values)) break;
    if (limit.is_reached() || (known != nullptr && is_at(*known, x, solver.fvec.squaredNorm()))) break;
  }
  if (functor.is_not_finite) found.end = SearchEnd::not_finite;
  if (limit.end()) found.end = *limit.end();
  found.x = std::move(x);
  found.cost = solver.fvec.squaredNorm();
  return found;
}

}  // namespace control
