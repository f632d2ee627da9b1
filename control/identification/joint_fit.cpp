// The sums over the runs, and the covariance of all parameters.
#include "control/identification/joint_fit.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "control/identification/fit_summary.hpp"
#include "control/search/fit_statistics.hpp"

namespace control {
namespace {

using Eigen::Index;

constexpr double kWhite = 0.01;
constexpr double kDoubtfulF = 20, kDoubtfulShare = 0.05;

// Slopes and residuals of one channel of one run, divided by the noise of that channel.
struct Block {
  std::size_t run = 0;
  Eigen::MatrixXd slopes;
  Eigen::VectorXd residual;
  double values = 0;  // that count
};

// A block for each run whose sensor has a prior beside its readings.
std::vector<Block> priors(JointSearch& search, Structure structure, const JointResult& found) {
  std::vector<Block> all;
  for (std::size_t i = 0; i < search.runs(); ++i) {
    const OutputErrorSearch& of_run = search.of_run(i);
    all.push_back({i, of_run.prior_slopes(structure, found.points[i]), {}, 0});
  }
  return all;
}

std::vector<Block> blocks(JointSearch& search, Cost cost, Structure structure, const JointResult& found) {
  const JointColumns columns = search.columns(structure);
  std::vector<Block> all;
  for (std::size_t i = 0; i < search.runs(); ++i) {
    OutputErrorSearch& of_run = search.of_run(i);
    const SensorPath* path = of_run.sensor();
    const auto residuals = of_run.residuals(found.points[i]);
    auto slopes = of_run.jacobians(structure, found.points[i]);
    const double channels = static_cast<double>(residuals.size());
    const double own = static_cast<double>(std::ssize(columns.of_run[i])) - columns.common;
    const double share = std::max(0.0, own) / channels + columns.common / channels / static_cast<double>(search.runs());
    for (std::size_t c = 0; c < residuals.size(); ++c) {
      const Eigen::VectorXd counted = of_run.counted(residuals[c]);
      const double values = static_cast<double>(counted.size() - (path ? path->bias_terms() : 0));
      const double scale = cost == Cost::least_squares
                               ? residuals[c].norm() / std::sqrt(std::max(1.0, values - share))
                               : absolute_error_scale(counted, static_cast<int>(std::lround(share)));
      const double sd = std::max(1e-200, scale);
      all.push_back({i, slopes[c] / sd, residuals[c] / sd, values});
    }
  }
  return all;
}

Eigen::MatrixXd stacked(const std::vector<Block>& all, const JointColumns& columns) {
  Index rows = 0;
  for (const Block& block : all) rows += block.slopes.rows();
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(rows, columns.all);
  rows = 0;
  for (const Block& block : all) {
    const std::vector<Index>& of_run = columns.of_run[block.run];
    for (std::size_t j = 0; j < of_run.size(); ++j) {
      result.col(of_run[j]).segment(rows, block.slopes.rows()) = block.slopes.col(static_cast<Index>(j));
    }
    rows += block.slopes.rows();
  }
  return result;
}

void take_sigmas(const Uncertainty& found, const std::vector<int>& free, const std::vector<Index>& column, Fit& fit) {
  const std::array<double, kParameters> unit{fit.model.kp, fit.model.b1, fit.model.b2, 1, 1};
  for (std::size_t i = 0; i < free.size(); ++i) {
    const auto& sigma = found.one_sigma[static_cast<std::size_t>(column[i])];
    if (free[i] == kOffset) fit.offset_sigma_m = sigma;
    if (free[i] == kDeadTime || (free[i] == kSensorTime && fit.model.dead_time_s > 0)) fit.dead_time_sigma_s = sigma;
    if (free[i] == kPositionClock) fit.position_clock_sigma_s = sigma;
    const auto row = static_cast<std::size_t>(free[i]);
    if (row >= kParameters) continue;
    if (sigma) fit.one_sigma[row] = *sigma * unit[row];
    for (std::size_t j = 0; j < free.size(); ++j) {
      const auto other = static_cast<std::size_t>(free[j]);
      if (other < kParameters) fit.correlation[row][other] = found.correlation(column[i], column[j]);
    }
  }
}

// Of a mean of independent ones.
std::optional<double> sigma_of_mean(const std::vector<Fit>& runs) {
  double sum = 0;
  for (const Fit& run : runs) {
    if (!run.dead_time_sigma_s) return std::nullopt;
    sum += *run.dead_time_sigma_s * *run.dead_time_sigma_s;
  }
  return std::sqrt(sum) / static_cast<double>(runs.size());
}

void add_uncertainty(JointSearch& search, Cost cost, const JointResult& found, JointFit& fit) {
  const Structure structure = fit.all.structure;
  const JointColumns columns = search.columns(structure);
  std::vector<Block> all = blocks(search, cost, structure, found);
  for (Block& block : priors(search, structure, found)) all.push_back(std::move(block));
  const Uncertainty sigmas = uncertainty(stacked(all, columns));
  for (std::size_t i = 0; i < search.runs(); ++i) {
    take_sigmas(sigmas, search.of_run(i).free_parameters(structure), columns.of_run[i], fit.runs[i]);
  }
  fit.all.one_sigma = fit.runs.front().one_sigma;
  fit.all.correlation = fit.runs.front().correlation;
  const auto positions = std::ranges::find_if(fit.runs, [](const Fit& run) { return !run.sensor; });
  fit.all.dead_time_sigma_s = positions != fit.runs.end() ? positions->dead_time_sigma_s : sigma_of_mean(fit.runs);
}

// The values of the run's first channel that count.
double values_of(OutputErrorSearch& search, const SearchPoint& point) {
  return static_cast<double>(search.counted(search.residuals(point).front()).size());
}

void add_quality(JointSearch& search, const JointResult& found, JointFit& fit) {
  double values = 0, motion = 0, squares = 0, squared_values = 0, least = 1;
  for (std::size_t i = 0; i < fit.runs.size(); ++i) {
    const Fit& run = fit.runs[i];
    const double n = values_of(search.of_run(i), found.points[i]), ratio = 1 - run.fit_percent / 100;
    values += n;
    motion += n / std::max(1e-300, ratio * ratio);
    least = std::min(least, run.whiteness_p_value);
    fit.all.drift_factor = std::max(fit.all.drift_factor, run.drift_factor);
    fit.all.colour_factor = std::max(fit.all.colour_factor, run.colour_factor);
    fit.all.sse += run.sse;
    fit.all.absolute_error += run.absolute_error;
    if (search.of_run(i).channels().front() != search.of_run(0).channels().front()) continue;
    squares += n * run.residual_sd * run.residual_sd;
    squared_values += n;
  }
  fit.all.fit_percent = 100 * (1 - std::sqrt(values / motion));  // (2)
  fit.all.residual_sd = std::sqrt(squares / squared_values);
  fit.all.whiteness_p_value = 1 - std::pow(1 - least, static_cast<double>(fit.runs.size()));  // (3)
  fit.all.residuals_are_white = fit.all.whiteness_p_value >= kWhite;
}

// What positions say, which know of it; of accelerations alone the mean.
double dead_time_s(const std::vector<Fit>& runs) {
  double sum_s = 0;
  for (const Fit& run : runs) {
    if (!run.sensor) return run.model.dead_time_s;
    sum_s += run.model.dead_time_s;
  }
  return sum_s / static_cast<double>(runs.size());
}

// By how much the run's own parameters could lower the squares of its residuals.
double explained_of(const Block& block) {
  const Eigen::VectorXd norm = block.slopes.colwise().norm().transpose().cwiseMax(1e-300).cwiseInverse();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
  qr.setThreshold(1e-9);
  qr.compute(block.slopes * norm.asDiagonal());
  const Eigen::VectorXd turned = qr.householderQ().transpose() * block.residual;
  return turned.head(qr.rank()).squaredNorm();
}

}  // namespace

JointFit joint_summary(JointSearch& search, std::span<const Recording> recordings, Cost cost, Structure structure,
                       const JointResult& found) {
  JointFit fit;
  fit.all.structure = structure;
  fit.all.free_parameters = search.columns(structure).all;
  fit.all.aic = 2.0 * fit.all.free_parameters;
  for (std::size_t i = 0; i < search.runs(); ++i) {
    const SearchResult of_run{found.points[i], found.end, found.iterations, 0, 0};
    fit.runs.push_back(summary(search.of_run(i), recordings[i], cost, structure, of_run));
    fit.all.aic += fit.runs.back().aic - 2.0 * fit.runs.back().free_parameters;
  }
  fit.all.model = fit.runs.front().model;
  fit.all.model.dead_time_s = dead_time_s(fit.runs);
  add_quality(search, found, fit);
  if (found.starts > 0) add_uncertainty(search, cost, found, fit);
  const auto take_end = [&found](Fit& of) {
    of.end = found.end;
    of.iterations = found.iterations;
    of.starts = found.starts;
    of.starts_that_agree = found.starts_that_agree;
  };
  take_end(fit.all);
  std::ranges::for_each(fit.runs, take_end);
  return fit;
}

std::optional<ScoreEvidence> disagreement(JointSearch& search, Structure structure, const JointResult& found) {
  if (found.starts == 0 || found.end != SearchEnd::converged) return std::nullopt;
  const JointColumns columns = search.columns(structure);
  double explained = 0, all = 0, values = 0;
  for (const Block& block : blocks(search, Cost::least_squares, structure, found)) {
    if (!block.slopes.allFinite() || !block.residual.allFinite()) return std::nullopt;
    explained += explained_of(block);
    all += block.residual.squaredNorm();
    values += block.values;
  }
  const double more = columns.common * static_cast<double>(search.runs() - 1);
  const double freedom = values - columns.all - more, share = explained / all;
  if (!(freedom > 0) || !(share < 1)) return std::nullopt;
  const double f = share / (1 - share) * freedom / more;  // (4)
  if (!(f > kDoubtfulF && share >= kDoubtfulShare)) return std::nullopt;
  return ScoreEvidence{share, f, std::sqrt(1 + share * values / columns.all)};
}

std::string disagreement_in_words(const ScoreEvidence& evidence) {
  std::ostringstream text;
  text.precision(3);
  text << "the runs do not agree on one model: parameters of their own would explain " << 100 * evidence.share
       << " % of what the common ones leave (F = " << evidence.f << ", above " << kDoubtfulF
       << "); fit each run by itself, and look for another fluid, another amplitude or a robot that has changed";
  return text.str();
}

}  // namespace control
