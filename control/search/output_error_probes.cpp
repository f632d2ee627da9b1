// What the model would put out at other duties, or later: directions to ask the residuals of a fit for.
#include <algorithm>

#include "control/search/output_error_search.hpp"

namespace control {

using Eigen::Index;

std::vector<Eigen::MatrixXd> OutputErrorSearch::model_slopes(const std::vector<double>& duty,
                                                             const SearchPoint& point) const {
  std::vector<Eigen::MatrixXd> result;
  for (const Measured& measured : measured_) {
    OutputModel model = measured.path
                            ? OutputModel::with_means(dt_s_, duty, kModelTolerance)
                            : OutputModel(measured.channel, dt_s_, duty, options_.longest_dead_time_s, kModelTolerance);
    if (!measured.path) model.set_delay(point.model.dead_time_s);
    const Eigen::MatrixXd of_model = model.jacobian(point.model);
    Eigen::MatrixXd slopes(rows_, of_model.cols());
    for (Index j = 0; j < slopes.cols(); ++j) slopes.col(j) = seen(measured, point, of_model.col(j));
    result.push_back(std::move(slopes));
  }
  return result;
}

// Of the first channel's output, by differences or sums.
std::vector<double> OutputErrorSearch::model_velocity_m_s(const SearchPoint& point) {
  Measured& measured = measured_.front();
  if (!measured.path) measured.model.set_delay(point.model.dead_time_s);
  const Eigen::VectorXd output = measured.model.output(point.model);
  std::vector<double> velocity_m_s(output.begin(), output.begin() + samples_);
  for (Index k = 1; k < samples_; ++k) {
    double& v = velocity_m_s[static_cast<std::size_t>(k)];
    if (measured.channel == Channel::position) v = (output[k] - output[k - 1]) / dt_s_;
    if (measured.path) v = velocity_m_s[static_cast<std::size_t>(k - 1)] + dt_s_ * output[samples_ + k];  // a mean
  }
  return velocity_m_s;
}

std::vector<Eigen::MatrixXd> OutputErrorSearch::late_outputs(const std::vector<Index>& samples,
                                                             const SearchPoint& point) {
  std::vector<Eigen::MatrixXd> result;
  for (Measured& measured : measured_) {
    if (!measured.path) measured.model.set_delay(point.model.dead_time_s);
    const Eigen::VectorXd output = measured.model.output(point.model);
    Eigen::MatrixXd late(rows_, static_cast<Index>(samples.size()));
    for (Index j = 0; j < late.cols(); ++j) {
      const Index by = std::min(samples[static_cast<std::size_t>(j)], samples_);
      Eigen::VectorXd column = Eigen::VectorXd::Zero(output.size());
      for (Index first = 0; first < output.size(); first += samples_) {  // the ticks; the means behind them, if any
        column.segment(first + by, samples_ - by) = output.segment(first, samples_ - by);
      }
      late.col(j) = seen(measured, point, column);
    }
    result.push_back(std::move(late));
  }
  return result;
}

}  // namespace control
