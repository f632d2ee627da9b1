// One descent to the least sum of squares, by Eigen's Levenberg-Marquardt (MINPACK's lmder) with the exact Jacobian.
//
// It has converged where the solver can lower the sum no further, or where ten iterations lower it by less than 0.002
// of its share per value: the 200 that a start has would then move the parameters by less than a fifth of a sigma. The
// limit is asked between all steps. Errors: none thrown; how the descent ended is in the result.
#pragma once

#include <Eigen/Core>
#include <functional>

#include "control/search/fit.hpp"
#include "control/search/search_limit.hpp"

namespace control {

// Shapes: residual has `values` elements, slopes are values × parameters. Both are of the right size already, and
// return false when the search is to stop.
struct SquaresToMinimise {
  Eigen::Index values = 0;
  std::function<bool(const Eigen::VectorXd& x, Eigen::VectorXd& residual)> residuals;
  std::function<bool(const Eigen::VectorXd& x, Eigen::MatrixXd& slopes)> slopes;
  std::function<double(const Eigen::VectorXd& residual)> sse;  // for the progress, in units of the channels
};

struct Descended {
  bool has_begun = false;  // else x is where it was to begin
  Eigen::VectorXd x;
  SearchEnd end = SearchEnd::converged;
  int iterations = 0;  // with those of the progress it began with
  double cost = 0;     // the sum of squares; infinite if it has not begun
};

// A minimum that an earlier descent has found. One that comes so near to it that it would end there ends at once.
struct KnownMinimum {
  static constexpr double kAgreement = 1e-6;  // of costs
  static constexpr double kNear = 1e-3;       // of the coordinates, which are of order 1

  Eigen::VectorXd x;
  double cost = 0;
};

// Whether the data, of this number of values, do not tell the one cost from the best one.
bool costs_agree(double cost, double best, double values);

Descended descend(const SquaresToMinimise& squares, Eigen::VectorXd x, int iteration_limit, Progress progress,
                  SearchLimit& limit, const KnownMinimum* known = nullptr);

}  // namespace control
