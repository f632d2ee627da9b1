// Stacks residuals and slopes of all runs, and descends on them as one search does on its channels.
#include "control/search/joint_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "control/search/descent.hpp"

namespace control {
namespace {

using Eigen::Index;

constexpr double kRoundingShare = 1e-9;  // residuals below this share of the signal are equal
constexpr int kWeightRounds = 3;
constexpr int kReweightings = 200;  // of the absolute error
constexpr int kIterationsPerReweighting = 3;
constexpr double kMeanSize = 0.8;  // of normal noise, in sds

bool is_common(int parameter) { return parameter < static_cast<int>(kParameters) || parameter == kDeadTime; }

// Of values that count: readings without weight are 0.
double rms_of(const OutputErrorSearch& search, const Eigen::VectorXd& residual) {
  const Index count = search.counted(residual).size();
  return residual.norm() / std::sqrt(static_cast<double>(std::max<Index>(1, count)));
}

}  // namespace

JointSearch::JointSearch(std::span<const Recording> recordings, const IdentificationOptions& options,
                         const SearchLimit::Clock& clock)
    : options_(options), limit_(options.time_limit_s, options.on_progress, clock) {
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    searches_.push_back(std::make_unique<OutputErrorSearch>(recordings[i], options, clock));
    if (recordings[i].duty.size() > recordings[longest_].duty.size()) longest_ = i;
  }
}

void JointSearch::find_sensors() {
  for (const auto& search : searches_) {
    if (search->sensor()) search->find_sensor();
  }
}

bool JointSearch::is_out_of_time() const {
  return limit_.has_passed() ||
         std::ranges::any_of(searches_, [](const auto& search) { return search->limit().has_passed(); });
}

void JointSearch::reset_weights() {
  is_of_absolute_error_ = false;
  weights_.assign(runs(), {});
  for (std::size_t i = 0; i < runs(); ++i) {
    const SearchPoint any = searches_[i]->start(Structure::first_order, 0);
    const auto parts = searches_[i]->residuals(any);
    for (std::size_t c = 0; c < parts.size(); ++c) {
      weights_[i].push_back({searches_[i]->spread_of(c), Eigen::VectorXd::Ones(parts[c].size())});
    }
  }
}

JointColumns JointSearch::columns(Structure structure) const {
  JointColumns columns;
  std::vector<int> common;
  for (const auto& search : searches_) {
    for (const int parameter : search->free_parameters(structure)) {
      if (is_common(parameter) && std::ranges::find(common, parameter) == common.end()) common.push_back(parameter);
    }
  }
  std::ranges::sort(common);
  columns.common = columns.all = static_cast<int>(common.size());
  for (const auto& search : searches_) {
    std::vector<Index>& of_run = columns.of_run.emplace_back();
    for (const int parameter : search->free_parameters(structure)) {
      of_run.push_back(is_common(parameter) ? std::ranges::find(common, parameter) - common.begin() : columns.all++);
    }
  }
  return columns;
}

// Each run's own timing and offset, and the model of the longest one.
JointSearch::Points JointSearch::start(Structure structure, int index) {
  Points points;
  for (const auto& search : searches_) points.push_back(search->start(structure, index));
  SearchPoint& first = points[longest_];
  if (options_.longest_dead_time_s > 0 && !searches_[longest_]->sensor()) {
    searches_[longest_]->fit_gain(first);
    searches_[longest_]->fit_dead_time(first);
  }
  const FractionalModel model = first.model;
  for (SearchPoint& point : points) point.model = model;
  fit_gain(structure, points);
  return points;
}

// The output is gain · g + offset · s: the gain from what is left of y and g without s, over all runs; then each
// offset.
void JointSearch::fit_gain(Structure structure, Points& points) {
  double of_both = 0, of_output = 0, of_measured = 0;
  for (std::size_t i = 0; i < runs(); ++i) {
    SearchPoint unit = points[i];
    unit.model.kp = 1;
    unit.offset_m = 0;
    const auto free = searches_[i]->free_parameters(structure);
    const auto at_offset = std::ranges::find(free, kOffset);
    const auto parts = searches_[i]->residuals(unit);
    const auto slopes = searches_[i]->jacobians(structure, unit);
    for (std::size_t c = 0; c < parts.size(); ++c) {
      const double sd = weights_[i][c].sd;
      Eigen::VectorXd g = slopes[c].col(0) / sd, y = parts[c] / sd + g;
      if (at_offset != free.end()) {
        const Eigen::VectorXd s = slopes[c].col(at_offset - free.begin());
        if (s.squaredNorm() > 0) {
          g -= g.dot(s) / s.squaredNorm() * s;
          y -= y.dot(s) / s.squaredNorm() * s;
        }
      }
      of_both += g.dot(y);
      of_output += g.squaredNorm();
      of_measured += y.squaredNorm();
    }
  }
  const double best = of_both / of_output, fallback = std::sqrt(of_measured / of_output);
  const double gain = best > 0 ? best : std::isfinite(fallback) && fallback > 0 ? fallback : 1;
  for (std::size_t i = 0; i < runs(); ++i) {
    points[i].model.kp = gain;
    points[i].offset_m = 0;
    const auto free = searches_[i]->free_parameters(structure);
    const auto at_offset = std::ranges::find(free, kOffset);
    if (at_offset == free.end()) continue;
    const Eigen::VectorXd s = searches_[i]->jacobians(structure, points[i]).front().col(at_offset - free.begin());
    const double offset_m = s.dot(searches_[i]->residuals(points[i]).front()) / s.squaredNorm();
    if (std::isfinite(offset_m)) points[i].offset_m = offset_m;
  }
}

Eigen::VectorXd JointSearch::coordinates(Structure structure, const Points& points) const {
  const JointColumns where = columns(structure);
  Eigen::VectorXd x(where.all);
  for (std::size_t i = 0; i < runs(); ++i) {
    const Eigen::VectorXd own = searches_[i]->coordinates(structure, points[i]);
    for (std::size_t j = 0; j < where.of_run[i].size(); ++j) x[where.of_run[i][j]] = own[static_cast<Index>(j)];
  }
  return x;
}

JointSearch::Points JointSearch::points_at(Structure structure, const Eigen::VectorXd& x) const {
  const JointColumns where = columns(structure);
  Points points;
  for (std::size_t i = 0; i < runs(); ++i) {
    const Eigen::VectorXd own = x(where.of_run[i]);
    points.push_back(searches_[i]->point_at(structure, own));
  }
  return points;
}

bool JointSearch::residuals_at(Structure structure, const Eigen::VectorXd& x, Eigen::VectorXd& residual) {
  const Points points = points_at(structure, x);
  Index row = 0;
  for (std::size_t i = 0; i < runs(); ++i) {
    const auto parts = searches_[i]->residuals(points[i]);
    if (limit_.is_reached()) return false;
    for (std::size_t c = 0; c < parts.size(); ++c) {
      residual.segment(row, parts[c].size()) = parts[c].cwiseProduct(weights_[i][c].root_weight) / weights_[i][c].sd;
      row += parts[c].size();
    }
    const Eigen::VectorXd of_prior = prior_weight(i) * searches_[i]->prior_residuals(structure, points[i]);
    residual.segment(row, of_prior.size()) = of_prior;
    row += of_prior.size();
  }
  return true;
}

bool JointSearch::slopes_at(Structure structure, const Eigen::VectorXd& x, Eigen::MatrixXd& slopes) {
  const Points points = points_at(structure, x);
  const JointColumns where = columns(structure);
  slopes.setZero();
  Index row = 0;
  for (std::size_t i = 0; i < runs(); ++i) {
    const auto parts = searches_[i]->jacobians(structure, points[i]);
    if (limit_.is_reached()) return false;
    const Eigen::VectorXd chain = searches_[i]->coordinate_slopes(structure, points[i]);
    for (std::size_t c = 0; c < parts.size(); ++c) {
      const Eigen::VectorXd weight = weights_[i][c].root_weight / -weights_[i][c].sd;
      for (Index j = 0; j < parts[c].cols(); ++j) {
        slopes.col(where.of_run[i][static_cast<std::size_t>(j)]).segment(row, parts[c].rows()) =
            chain[j] * weight.cwiseProduct(parts[c].col(j));
      }
      row += parts[c].rows();
    }
    const Eigen::MatrixXd of_prior = prior_weight(i) * searches_[i]->prior_slopes(structure, points[i]);
    for (Index j = 0; j < of_prior.cols(); ++j) {
      slopes.col(where.of_run[i][static_cast<std::size_t>(j)]).segment(row, of_prior.rows()) =
          chain[j] * of_prior.col(j);
    }
    row += of_prior.rows();
  }
  return true;
}

// The root of what the prior of a run's sensor weighs, by the sum that is minimised.
double JointSearch::prior_weight(std::size_t run) const {
  const double noise = searches_[run]->reading_sd_m_s2() / weights_[run].front().sd;
  return is_of_absolute_error_ ? std::sqrt(kMeanSize * noise) : noise;
}

double JointSearch::sse_of(const Eigen::VectorXd& residual) const {
  double sum = 0;
  Index row = 0;
  for (std::size_t i = 0; i < runs(); ++i) {
    for (const Weight& weight : weights_[i]) {
      sum += weight.sd * weight.sd * residual.segment(row, weight.root_weight.size()).squaredNorm();
      row += weight.root_weight.size();
    }
    row += prior_values_[i];
  }
  return sum;
}

SearchEnd JointSearch::descend(Structure structure, Points& points, int iteration_limit, Progress progress,
                               const KnownMinimum* known) {
  SquaresToMinimise squares;
  for (const auto& of_run : weights_) {
    for (const Weight& weight : of_run) squares.values += weight.root_weight.size();
  }
  prior_values_.clear();
  for (std::size_t i = 0; i < runs(); ++i) {
    prior_values_.push_back(searches_[i]->prior_residuals(structure, points[i]).size());
    squares.values += prior_values_.back();
  }
  squares.residuals = [&](const Eigen::VectorXd& x, Eigen::VectorXd& residual) {
    return residuals_at(structure, x, residual);
  };
  squares.slopes = [&](const Eigen::VectorXd& x, Eigen::MatrixXd& slopes) { return slopes_at(structure, x, slopes); };
  squares.sse = [&](const Eigen::VectorXd& residual) { return sse_of(residual); };
  const Descended found =
      control::descend(squares, coordinates(structure, points), iteration_limit, progress, limit_, known);
  last_iterations_ = found.iterations;
  last_cost_ = found.cost;
  if (found.has_begun && found.x.allFinite()) points = points_at(structure, found.x);
  return found.end;
}

JointResult JointSearch::run(Structure structure) {
  reset_weights();
  JointResult result;
  run_starts(structure, result);
  if (!limit_.end() && result.starts > 0) refine_weights(structure, result);
  if (!limit_.end() && result.starts > 0 && options_.cost == Cost::absolute_error) {
    refine_absolute_error(structure, result);
  }
  if (limit_.end()) result.end = *limit_.end();
  if (result.starts == 0) result.points = start(structure, 0);
  return result;
}

void JointSearch::run_starts(Structure structure, JointResult& result) {
  std::vector<double> costs;
  const int starts = 1 + options_.further_starts;
  double values = 0;
  for (const auto& of_run : weights_) values += static_cast<double>(of_run.front().root_weight.size());
  const double rounding = kRoundingShare * kRoundingShare * values;
  double best = std::numeric_limits<double>::infinity();
  std::optional<KnownMinimum> minimum;
  for (int index = 0; index < starts; ++index) {
    const Progress progress{structure, index, starts, 0, 0};
    limit_.begin(progress);
    if (limit_.is_reached()) break;
    Points points = start(structure, index);
    if (limit_.is_reached()) break;
    const SearchEnd end = descend(structure, points, options_.iteration_limit, progress, minimum ? &*minimum : nullptr);
    if (limit_.end() && last_iterations_ == 0) break;
    if (costs.empty() || last_cost_ < best) {
      best = std::min(best, last_cost_);
      result.points = points;
      result.end = end;
      result.iterations = last_iterations_;
      minimum.reset();
      if (end == SearchEnd::converged) minimum = {coordinates(structure, points), last_cost_};
    }
    costs.push_back(last_cost_);
    if (limit_.end()) break;
  }
  result.starts = static_cast<int>(costs.size());
  result.starts_that_agree = static_cast<int>(
      std::ranges::count_if(costs, [&](double found) { return costs_agree(found - rounding, best, values); }));
}

void JointSearch::refine_weights(Structure structure, JointResult& result) {
  for (int round = 0; round < kWeightRounds; ++round) {
    for (std::size_t i = 0; i < runs(); ++i) {
      const auto parts = searches_[i]->residuals(result.points[i]);
      if (limit_.is_reached()) return;
      for (std::size_t c = 0; c < parts.size(); ++c) {
        const double floor = 1e-13 * searches_[i]->spread_of(c);
        weights_[i][c].sd = std::max(floor, rms_of(*searches_[i], parts[c]));
      }
    }
    result.end = descend(structure, result.points, options_.iteration_limit,
                         {structure, result.starts - 1, result.starts, result.iterations, 0});
    result.iterations = last_iterations_;
    if (limit_.end()) return;
  }
}

double JointSearch::absolute_cost(Structure structure, const Points& points) {
  double sum = 0;
  for (std::size_t i = 0; i < runs(); ++i) {
    const auto parts = searches_[i]->residuals(points[i]);
    for (std::size_t c = 0; c < parts.size(); ++c) sum += (parts[c] / weights_[i][c].sd).lpNorm<1>();
    const double weight = prior_weight(i);
    sum += weight * weight / 2 * searches_[i]->prior_residuals(structure, points[i]).squaredNorm();
  }
  return sum;
}

// Weights 1/|r| make the squares of (1) the absolute values of (2); each round must lower (2), or is the last.
void JointSearch::refine_absolute_error(Structure structure, JointResult& result) {
  is_of_absolute_error_ = true;
  double lowest = absolute_cost(structure, result.points);
  result.end = SearchEnd::iteration_limit;
  Points points = result.points;
  int small_gains = 0;
  for (int round = 0; round < kReweightings && !limit_.is_reached(); ++round) {
    for (std::size_t i = 0; i < runs(); ++i) {
      const auto parts = searches_[i]->residuals(points[i]);
      for (std::size_t c = 0; c < parts.size(); ++c) {
        Weight& weight = weights_[i][c];
        const double floor = std::max(1e-6 * parts[c].cwiseAbs().mean(), 1e-14 * weight.sd);
        weight.root_weight = (parts[c].cwiseAbs().cwiseMax(floor) / weight.sd).cwiseSqrt().cwiseInverse();
      }
    }
    const SearchEnd end = descend(structure, points, kIterationsPerReweighting,
                                  {structure, result.starts - 1, result.starts, result.iterations, 0});
    result.iterations = last_iterations_;
    if (end == SearchEnd::not_finite) result.end = end;
    if (limit_.end() || end == SearchEnd::not_finite) return;
    const double found = absolute_cost(structure, points);
    small_gains = found > lowest * (1 - 1e-8) ? small_gains + 1 : 0;
    if (found < lowest) lowest = found, result.points = points;
    if (small_gains == 3) {
      result.end = SearchEnd::converged;
      return;
    }
  }
}

}  // namespace control
