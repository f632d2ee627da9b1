// What the model would put out at other duties, or later: directions to ask the residuals of a fit for.
#include <algorithm>

#include "control/output_error_search.hpp"

namespace control {

using Eigen::Index;

std::vector<Eigen::MatrixXd> OutputErrorSearch::model_slopes(const std::vector<double>& duty,
                                                             const SearchPoint& point) const {
  std::vector<Eigen::MatrixXd> result;
  for (const Measured& measured : measured_) {
    const double longest_s = measured.path ? 0 : options_.longest_dead_time_s;
    OutputModel model(measured.channel, dt_s_, duty, longest_s, kModelTolerance);
    if (!measured.path) model.set_delay(point.model.dead_time_s);
    Eigen::MatrixXd slopes = model.jacobian(point.model);
    for (Index j = 0; j < slopes.cols(); ++j) slopes.col(j) = seen(measured, point, slopes.col(j)).eval();
    result.push_back(std::move(slopes));
  }
  return result;
}

// Of the first channel's output, by differences or sums.
std::vector<double> OutputErrorSearch::model_velocity_m_s(const SearchPoint& point) {
  Measured& measured = measured_.front();
  if (!measured.path) measured.model.set_delay(point.model.dead_time_s);
  const Eigen::VectorXd output = measured.model.output(point.model);
  std::vector<double> velocity_m_s(output.begin(), output.end());
  for (Index k = 1; k < samples_; ++k) {
    double& v = velocity_m_s[static_cast<std::size_t>(k)];
    if (measured.channel == Channel::position) v = (output[k] - output[k - 1]) / dt_s_;
    if (measured.channel == Channel::acceleration)
      v = velocity_m_s[static_cast<std::size_t>(k - 1)] + dt_s_ * output[k];
  }
  return velocity_m_s;
}

std::vector<Eigen::MatrixXd> OutputErrorSearch::late_outputs(const std::vector<Index>& samples,
                                                             const SearchPoint& point) {
  std::vector<Eigen::MatrixXd> result;
  for (Measured& measured : measured_) {
    if (!measured.path) measured.model.set_delay(point.model.dead_time_s);
    const Eigen::VectorXd output = measured.model.output(point.model);
    Eigen::MatrixXd late(samples_, static_cast<Index>(samples.size()));
    for (Index j = 0; j < late.cols(); ++j) {
      const Index by = std::min(samples[static_cast<std::size_t>(j)], samples_);
      Eigen::VectorXd column = Eigen::VectorXd::Zero(samples_);
      column.tail(samples_ - by) = output.head(samples_ - by);
      late.col(j) = seen(measured, point, column);
    }
    result.push_back(std::move(late));
  }
  return result;
}

}  // namespace control
