// Residuals, AIC and uncertainty of a point that a search ended at.
#include "control/identification/fit_summary.hpp"

#include <algorithm>
#include <cmath>

#include "control/identification/residual_doubts.hpp"
#include "control/search/fit_statistics.hpp"

namespace control {
namespace {

using Eigen::Index;

constexpr double kSmallestResidualShare = 1e-9;  // of the signal; what is less is rounding and no reason to choose
constexpr double kWhite = 0.01;
constexpr double kFitOfRounding = 100 - 1e-6;  // percent; what is left is no noise

double akaike(const OutputErrorSearch& search, Cost cost, const std::vector<Eigen::VectorXd>& residuals,
              const std::vector<const std::vector<double>*>& measured, int free_parameters) {
  double sum = 2.0 * free_parameters;
  for (std::size_t c = 0; c < residuals.size(); ++c) {
    const double n = static_cast<double>(search.counted(residuals[c]).size());
    const Eigen::Map<const Eigen::VectorXd> y(measured[c]->data(), residuals[c].size());
    const double floor = kSmallestResidualShare * std::sqrt((y.array() - y.mean()).square().mean());
    const double sd = std::max(floor, residuals[c].norm() / std::sqrt(n));
    const double mean_size = std::max(floor, residuals[c].lpNorm<1>() / n);
    sum += 2 * n * std::log(cost == Cost::least_squares ? sd : mean_size);
  }
  return sum;
}

void add_uncertainty(OutputErrorSearch& search, const SearchPoint& point, const std::vector<Eigen::VectorXd>& residuals,
                     Cost cost, Fit& fit) {
  const std::vector<int> free = search.free_parameters(fit.structure);
  std::vector<Eigen::MatrixXd> jacobians = search.jacobians(fit.structure, point);
  const double channels = static_cast<double>(jacobians.size());
  const Eigen::MatrixXd of_prior = search.prior_slopes(fit.structure, point);
  Eigen::MatrixXd stacked(jacobians.front().rows() * static_cast<Index>(jacobians.size()) + of_prior.rows(),
                          static_cast<Index>(free.size()));
  stacked.bottomRows(of_prior.rows()) = of_prior;
  for (std::size_t c = 0; c < jacobians.size(); ++c) {
    const Index samples = jacobians[c].rows();
    const SensorPath* path = search.sensor();
    const Index counted = search.counted(residuals[c]).size() - (path ? path->bias_terms() : 0);
    const double freedom = static_cast<double>(counted) - static_cast<double>(free.size()) / channels;
    const double scale = cost == Cost::least_squares
                             ? residuals[c].norm() / std::sqrt(freedom)
                             : absolute_error_scale(search.counted(residuals[c]), static_cast<int>(free.size()));
    const double sd = std::max(1e-200, scale);
    stacked.middleRows(static_cast<Index>(c) * samples, samples) = jacobians[c] / sd;
  }
  const Uncertainty found = uncertainty(stacked);
  const std::array<double, kParameters> unit{fit.model.kp, fit.model.b1, fit.model.b2, 1, 1};
  for (std::size_t i = 0; i < free.size(); ++i) {
    const auto row = static_cast<std::size_t>(free[i]);
    if (free[i] == kOffset) fit.offset_sigma_m = found.one_sigma[i];
    if (free[i] == kDeadTime || (free[i] == kSensorTime && fit.model.dead_time_s > 0)) {
      fit.dead_time_sigma_s = found.one_sigma[i];
    }
    if (free[i] == kPositionClock) fit.position_clock_sigma_s = found.one_sigma[i];
    if (row >= kParameters) continue;
    if (found.one_sigma[i]) fit.one_sigma[row] = *found.one_sigma[i] * unit[row];
    for (std::size_t j = 0; j < free.size(); ++j) {
      const auto column = static_cast<std::size_t>(free[j]);
      if (column >= kParameters) continue;
      fit.correlation[row][column] = found.correlation(static_cast<Index>(i), static_cast<Index>(j));
    }
  }
}

void add_quality(const OutputErrorSearch& search, const Eigen::VectorXd& residual, const std::vector<double>& measured,
                 const std::vector<double>& sd_m, Fit& fit) {
  fit.fit_percent = fit_percent(search, {residual.begin(), residual.end()}, measured, sd_m);
  const Eigen::VectorXd counted = search.counted(residual);
  fit.residual_sd = counted.norm() / std::sqrt(static_cast<double>(counted.size()));
}

std::optional<double>& p_value_of(Channel channel, Fit& fit) {
  return channel == Channel::position   ? fit.position_whiteness_p_value
         : channel == Channel::velocity ? fit.velocity_whiteness_p_value
                                        : fit.acceleration_whiteness_p_value;
}

std::vector<double>& residual_of(Channel channel, Fit& fit) {
  return channel == Channel::position   ? fit.position_residual_m
         : channel == Channel::velocity ? fit.velocity_residual_m_s
                                        : fit.acceleration_residual_m_s2;
}

const std::vector<double>& measured_of(Channel channel, const Recording& recording) {
  return channel == Channel::position   ? recording.position_m
         : channel == Channel::velocity ? recording.velocity_m_s
                                        : recording.acceleration_m_s2;
}

void add_whiteness(const OutputErrorSearch& search, const std::vector<Eigen::VectorXd>& residuals, double duration_s,
                   Fit& fit) {
  const std::vector<Channel> channels = search.channels();
  fit.whiteness_p_value = 1;
  for (std::size_t c = 0; c < residuals.size(); ++c) {
    const Eigen::VectorXd counted = search.counted(residuals[c]);
    const double p = whiteness_p_value(counted);
    p_value_of(channels[c], fit) = p;
    fit.whiteness_p_value = std::min(fit.whiteness_p_value, p);
    if (!(fit.fit_percent < kFitOfRounding)) continue;
    fit.colour_factor = std::max(fit.colour_factor, std::sqrt(samples_per_independent_one(counted)));
    fit.drift_factor = std::max(fit.drift_factor, drift_factor(counted, values_in_2_s(counted.size(), duration_s)));
  }
  fit.residuals_are_white = fit.whiteness_p_value >= kWhite;
}

}  // namespace

Fit summary(OutputErrorSearch& search, const Recording& recording, Cost cost, Structure structure,
            const SearchResult& found) {
  Fit fit;
  fit.structure = structure;
  fit.model = found.point.model;
  fit.model.dead_time_s = search.dead_time_s(found.point);
  fit.offset_m = found.point.offset_m;
  fit.position_clock_s = found.point.position_clock_s;
  fit.sensor = search.sensor_fit(found.point);
  fit.end = found.end;
  fit.iterations = found.iterations;
  fit.starts = found.starts;
  fit.starts_that_agree = found.starts_that_agree;
  fit.free_parameters = static_cast<int>(search.free_parameters(structure).size());

  const std::vector<Eigen::VectorXd> residuals = search.residuals(found.point);
  std::vector<const std::vector<double>*> measured;
  const std::vector<Channel> channels = search.channels();
  for (std::size_t c = 0; c < residuals.size(); ++c) {
    measured.push_back(&measured_of(channels[c], recording));
    residual_of(channels[c], fit).assign(residuals[c].begin(), residuals[c].end());
    fit.sse += residuals[c].squaredNorm();
    fit.absolute_error += residuals[c].lpNorm<1>() * recording.dt_s;
  }
  add_quality(search, residuals.front(), *measured.front(), recording.position_sd_m, fit);
  add_whiteness(search, residuals, recording.dt_s * static_cast<double>(recording.duty.size()), fit);
  fit.aic = akaike(search, cost, residuals, measured, fit.free_parameters);
  if (found.starts > 0) add_uncertainty(search, found.point, residuals, cost, fit);
  return fit;
}

}  // namespace control
