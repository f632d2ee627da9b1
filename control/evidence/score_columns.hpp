// The columns of a score test: residuals of a fit, what its parameters and disturbances could make of them, and what is
// beyond that.
//
// Values of all channels stand one below the other, in units of the channel's residual.
#pragma once

#include <Eigen/Core>
#include <Eigen/QR>
#include <optional>
#include <vector>

#include "control/search/fit.hpp"
#include "control/search/output_error_search.hpp"

namespace control {

inline constexpr double kDependent = 1e-3;  // of a direction, what others cannot make of it, relative

Eigen::MatrixXd stacked(const std::vector<Eigen::MatrixXd>& parts, const std::vector<double>& sd);
Eigen::MatrixXd side_by_side(const std::vector<Eigen::MatrixXd>& blocks);  // each column of length 1, or 0

// The slopes by the parameters of a structure, as free_parameters() has them, and what neither model nor duty did:
// another reading of the sensor, or a drift of the position.
std::vector<Eigen::MatrixXd> own_and_disturbed(OutputErrorSearch& search, const Recording& recording,
                                               Structure structure, const SearchPoint& point,
                                               const std::vector<double>& sd);

using Qr = Eigen::ColPivHouseholderQR<Eigen::MatrixXd>;

Qr directions(const Eigen::MatrixXd& columns, double threshold);
Eigen::MatrixXd beyond(const Qr& qr, const Eigen::MatrixXd& columns);  // what the directions cannot make of each

struct Residuals {
  std::vector<double> sd;  // of each channel
  Eigen::VectorXd column;
  Eigen::Index values = 0;  // that count
};

// None: they are rounding, or the search was cut off.
std::optional<Residuals> residuals_of(OutputErrorSearch& search, const Fit& fit, const SearchPoint& point);

}  // namespace control
