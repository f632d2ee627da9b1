// Stacks, scales and projects.
#include "control/evidence/score_columns.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace control {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFitOfRounding = 100 - 1e-6;  // percent
constexpr double kWindowS = 1;                 // a clock that is off by 0.5 % drifts by half a sample
constexpr Index kMostWindows = 60;
constexpr double kShortestLag = 2;  // samples

// An age of the readings that is another one in each window, where the sensor's clock was not found: a step here and a
// larger one there would seem to differ else.
MatrixXd ages(const MatrixXd& slopes, const std::vector<int>& free, Index window) {
  const auto at = std::ranges::find(free, static_cast<int>(kSensorTime)) - free.begin();
  const VectorXd slope = slopes.col(at);
  const Index samples = slope.size();
  MatrixXd all = MatrixXd::Zero(samples, (samples + window - 1) / window);
  for (Index k = 0; k < samples; ++k) all(k, k / window) = slope[k];
  return all;
}

// Columns of what the duty did not cause: an offset and a drift of each channel, and what a motion before the run
// leaves, at several lags.
MatrixXd motions(Index samples, Index channels) {
  std::vector<VectorXd> shapes{VectorXd::Ones(samples), VectorXd::LinSpaced(samples, -1, 1)};
  const Eigen::ArrayXd tick = Eigen::ArrayXd::LinSpaced(samples, 0, static_cast<double>(samples - 1));
  for (double lag = static_cast<double>(samples) / 4; lag > kShortestLag; lag /= 3) {
    shapes.emplace_back((-tick / lag).exp().matrix());
  }
  const Index count = std::ssize(shapes);
  MatrixXd all = MatrixXd::Zero(samples * channels, count * channels);
  for (Index c = 0; c < channels; ++c) {
    for (Index j = 0; j < count; ++j) {
      all.block(c * samples, c * count + j, samples, 1) = shapes[static_cast<std::size_t>(j)];
    }
  }
  return all;
}

}  // namespace

MatrixXd stacked(const std::vector<MatrixXd>& parts, const std::vector<double>& sd) {
  const Index samples = parts.front().rows();
  MatrixXd all(samples * std::ssize(parts), parts.front().cols());
  for (std::size_t c = 0; c < parts.size(); ++c) {
    all.middleRows(static_cast<Index>(c) * samples, samples) = parts[c] / sd[c];
  }
  return all;
}

std::vector<MatrixXd> own_and_disturbed(OutputErrorSearch& search, const Recording& recording, Structure structure,
                                        const SearchPoint& point, const std::vector<double>& sd) {
  std::vector<MatrixXd> all{stacked(search.jacobians(structure, point), sd)};
  const auto samples = static_cast<Index>(recording.duty.size());
  if (const SensorPath* path = search.sensor()) {
    const auto ticks_in_window = static_cast<Index>(std::ceil(kWindowS / recording.dt_s));
    const Index window = std::max(ticks_in_window, samples / kMostWindows + 1);
    if (!path->has_own_clock()) all.push_back(ages(all[0], search.free_parameters(structure), window));
  } else {
    MatrixXd moved = motions(all[0].rows() / std::ssize(sd), std::ssize(sd));
    if (const PositionTimes* times = search.position_times()) {
      for (Index j = 0; j < moved.cols(); ++j) moved.col(j) = times->weighed(moved.col(j));
    }
    all.push_back(std::move(moved));
  }
  return all;
}

MatrixXd side_by_side(const std::vector<MatrixXd>& blocks) {
  Index columns = 0;
  for (const MatrixXd& block : blocks) columns += block.cols();
  MatrixXd all(blocks.front().rows(), columns);
  columns = 0;
  for (const MatrixXd& block : blocks) {
    all.middleCols(columns, block.cols()) = block;
    columns += block.cols();
  }
  for (Index j = 0; j < columns; ++j) {
    const double norm = all.col(j).norm();
    if (norm > 0) all.col(j) /= norm;
  }
  return all;
}

Qr directions(const MatrixXd& columns, double threshold) {
  Qr qr;
  qr.setThreshold(threshold);
  qr.compute(columns);
  return qr;
}

MatrixXd beyond(const Qr& qr, const MatrixXd& columns) {
  MatrixXd turned = qr.householderQ().transpose() * columns;
  turned.topRows(qr.rank()).setZero();
  return qr.householderQ() * turned;
}

std::optional<Residuals> residuals_of(OutputErrorSearch& search, const Fit& fit, const SearchPoint& point) {
  const bool is_rounding = fit.fit_percent >= kFitOfRounding;
  if (is_rounding || (fit.end != SearchEnd::converged && fit.end != SearchEnd::iteration_limit) || search.limit().end())
    return std::nullopt;
  if (fit.sensor && fit.sensor->delay_is_at_limit) return std::nullopt;  // what it lacks follows the steps of the duty
  Residuals residuals;
  if (search.sensor()) residuals.values = -search.sensor()->bias_terms();
  std::vector<MatrixXd> columns;
  for (const VectorXd& residual : search.residuals(point)) {
    residuals.sd.push_back(std::max(1e-200, residual.norm()));
    residuals.values += search.counted(residual).size();
    columns.emplace_back(residual);
  }
  residuals.column = stacked(columns, residuals.sd);
  return residuals;
}

}  // namespace control
