// Descends from each start, and weighs channels and residuals anew where the cost asks for it.
#include "control/output_error_search.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <unsupported/Eigen/NonLinearOptimization>

namespace control {
namespace {

using Eigen::Index;

constexpr double kModelTolerance = 3e-13;
constexpr double kNearestToBound = 1e-9;  // of the orders and the dead time, as a share of their interval
constexpr double kLargestLog = 60;        // of the gain and the coefficients, against their start in the search
constexpr double kRoundingShare = 1e-9;   // residuals below this share of the signal are equal
constexpr double kAgreement = 1e-6;       // of costs
constexpr int kWeightRounds = 3;          // of two channels
constexpr int kReweightings = 200;        // of the absolute error
constexpr int kIterationsPerReweighting = 3;

double logit(double share) { return std::log(share / (1 - share)); }

double logistic(double x) { return std::clamp(1 / (1 + std::exp(-x)), kNearestToBound, 1 - kNearestToBound); }

double inside(double share) { return std::clamp(share, kNearestToBound, 1 - kNearestToBound); }

// 1/2, 1/4, 3/4, 1/8, 5/8, ... for 1, 2, ...: spread evenly however many are taken.
double spread(int index) {
  double value = 0, place = 0.5;
  for (; index > 0; index /= 2, place /= 2) value += place * (index % 2);
  return value;
}

double scale_of(const Eigen::VectorXd& values) { return std::sqrt((values.array() - values.mean()).square().mean()); }

std::chrono::steady_clock::time_point deadline_in(double seconds) {
  const double bounded_s = std::clamp(seconds, 0.0, 1e6);
  return std::chrono::steady_clock::now() +
         std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(bounded_s));
}

}  // namespace

struct OutputErrorSearch::Descent {
  using Scalar = double;
  OutputErrorSearch& search;
  Structure structure;

  int operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual) const {
    if (search.is_late()) return -1;
    residual.setConstant(1e100);  // refused by the solver
    if (!x.allFinite() || x.head(1).cwiseAbs().maxCoeff() > 700) return 0;
    const SearchPoint point = search.point_at(structure, x);
    const auto parts = search.residuals(point);
    Index row = 0;
    for (std::size_t c = 0; c < parts.size(); ++c, row += search.samples_) {
      const Measured& measured = search.measured_[c];
      residual.segment(row, search.samples_) = parts[c].cwiseProduct(measured.root_weight) / measured.sd;
    }
    if (!residual.allFinite()) residual.setConstant(1e100);
    return 0;
  }

  int df(const Eigen::VectorXd& x, Eigen::MatrixXd& slopes) const {
    if (search.is_late()) return -1;
    const SearchPoint point = search.point_at(structure, x);
    const auto parts = search.jacobians(structure, point);
    const Eigen::VectorXd chain = search.coordinate_slopes(structure, point);
    Index row = 0;
    for (std::size_t c = 0; c < parts.size(); ++c, row += search.samples_) {
      const Measured& measured = search.measured_[c];
      slopes.middleRows(row, search.samples_) =
          (measured.root_weight / -measured.sd).asDiagonal() * parts[c] * chain.asDiagonal();
    }
    return slopes.allFinite() ? 0 : -1;
  }

  Index values() const { return search.samples_ * static_cast<Index>(search.measured_.size()); }
};

OutputErrorSearch::OutputErrorSearch(const Recording& recording, const IdentificationOptions& options)
    : options_(options),
      dt_s_(recording.dt_s),
      samples_(static_cast<Index>(recording.duty.size())),
      deadline_(deadline_in(options.time_limit_s)) {
  const auto add = [&](Channel channel, const std::vector<double>& values) {
    if (values.empty()) return;
    const Eigen::VectorXd measured = Eigen::Map<const Eigen::VectorXd>(values.data(), samples_);
    measured_.push_back({channel,
                         OutputModel(channel, dt_s_, recording.duty, options.longest_dead_time_s, kModelTolerance),
                         measured, scale_of(measured), Eigen::VectorXd::Ones(samples_)});
    if (channel == Channel::position) offset_scale_m_ = measured_.back().sd;
  };
  add(Channel::position, recording.position_m);
  add(Channel::velocity, recording.velocity_m_s);
}

std::vector<int> OutputErrorSearch::free_parameters(Structure structure) const {
  std::vector<int> free = structure == Structure::fractional     ? std::vector<int>{0, 1, 2, 3, 4}
                          : structure == Structure::second_order ? std::vector<int>{0, 1, 2}
                                                                 : std::vector<int>{0, 2};
  if (options_.fits_offset && measured_.front().channel == Channel::position) free.push_back(kOffset);
  if (options_.longest_dead_time_s > 0) free.push_back(kDeadTime);
  return free;
}

std::vector<Channel> OutputErrorSearch::channels() const {
  std::vector<Channel> result;
  for (const Measured& measured : measured_) result.push_back(measured.channel);
  return result;
}

std::vector<Eigen::VectorXd> OutputErrorSearch::residuals(const SearchPoint& point) {
  std::vector<Eigen::VectorXd> result;
  for (Measured& measured : measured_) {
    measured.model.set_delay(point.dead_time_s);
    const double offset_m = measured.channel == Channel::position ? point.offset_m : 0;
    result.emplace_back((measured.measured - measured.model.output(point.model)).array() - offset_m);
  }
  return result;
}

std::vector<Eigen::MatrixXd> OutputErrorSearch::jacobians(Structure structure, const SearchPoint& point) {
  const std::vector<int> free = free_parameters(structure);
  std::vector<Eigen::MatrixXd> result;
  for (Measured& measured : measured_) {
    measured.model.set_delay(point.dead_time_s);
    const Eigen::MatrixXd of_model = measured.model.jacobian(point.model);
    Eigen::MatrixXd slopes(samples_, static_cast<Index>(free.size()));
    for (Index j = 0; j < slopes.cols(); ++j) {
      const int parameter = free[static_cast<std::size_t>(j)];
      if (parameter == kOffset) {
        slopes.col(j).setConstant(measured.channel == Channel::position ? 1 : 0);
      } else if (parameter == kDeadTime) {
        slopes.col(j) = -measured.model.slope(point.model);
      } else {
        slopes.col(j) = of_model.col(parameter);
      }
    }
    result.push_back(std::move(slopes));
  }
  return result;
}

Eigen::VectorXd OutputErrorSearch::coordinates(Structure structure, const SearchPoint& point) const {
  const double dead_time_share = inside(point.dead_time_s / options_.longest_dead_time_s);
  const FractionalModel& m = point.model;
  Eigen::VectorXd all(7);
  all << std::log(m.kp), std::log(m.b1), std::log(m.b2), logit(inside(m.alpha - 1)), logit(inside(m.beta)),
      point.offset_m / offset_scale_m_, logit(dead_time_share);
  return all(free_parameters(structure));
}

SearchPoint OutputErrorSearch::point_at(Structure structure, const Eigen::VectorXd& x) const {
  SearchPoint point{{1, 0, 1, 1, 2, 1}, 0, 0};
  const std::vector<int> free = free_parameters(structure);
  for (std::size_t j = 0; j < free.size(); ++j) {
    const double value = x[static_cast<Index>(j)];
    switch (free[j]) {
      case 0: point.model.kp = std::exp(value); break;
      case 1: point.model.b1 = std::exp(std::clamp(value, -kLargestLog, kLargestLog)); break;
      case 2: point.model.b2 = std::exp(std::clamp(value, -kLargestLog, kLargestLog)); break;
      case 3: point.model.alpha = 1 + logistic(value); break;
      case 4: point.model.beta = logistic(value); break;
      case kOffset: point.offset_m = value * offset_scale_m_; break;
      default: point.dead_time_s = logistic(value) * options_.longest_dead_time_s;
    }
  }
  return point;
}

Eigen::VectorXd OutputErrorSearch::coordinate_slopes(Structure structure, const SearchPoint& point) const {
  const FractionalModel& m = point.model;
  const double longest_s = options_.longest_dead_time_s;
  Eigen::VectorXd all(7);
  all << 1, 1, 1, (m.alpha - 1) * (2 - m.alpha), m.beta * (1 - m.beta), offset_scale_m_,
      longest_s > 0 ? point.dead_time_s * (1 - point.dead_time_s / longest_s) : 0;
  return all(free_parameters(structure));
}

// The Newtonian model first, a hair inside the bounds; then lags spread over what the record can show.
SearchPoint OutputErrorSearch::start(Structure structure, int index) const {
  FractionalModel model = normalised(kNewtonianModel);
  model.alpha = 1.98, model.beta = 0.98;
  if (index > 0) {
    const double shortest_s = 2 * dt_s_, longest_s = dt_s_ * static_cast<double>(samples_) / 4;
    const double lag_s = shortest_s * std::pow(longest_s / shortest_s, spread(index));
    model.alpha = 1.15 + 0.7 * spread(3 * index + 1), model.beta = 0.95 - 0.5 * spread(index + 2);
    model.b2 = std::pow(lag_s, model.beta);
    model.b1 = model.b2 * std::pow(lag_s / 4, model.alpha - model.beta);
  }
  if (structure != Structure::fractional) model.alpha = 2, model.beta = 1;
  if (structure == Structure::first_order) model.b1 = 0;
  return {model, 0, 0};
}

void OutputErrorSearch::fit_gain(SearchPoint& point) {
  point.model.kp = 1;
  const bool has_offset = options_.fits_offset && measured_.front().channel == Channel::position;
  const Index count = static_cast<Index>(measured_.size());
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(samples_ * count, has_offset ? 2 : 1);
  Eigen::VectorXd target(samples_ * count);
  for (Index c = 0; c < count; ++c) {
    Measured& measured = measured_[static_cast<std::size_t>(c)];
    measured.model.set_delay(point.dead_time_s);
    columns.col(0).segment(c * samples_, samples_) = measured.model.output(point.model) / measured.sd;
    target.segment(c * samples_, samples_) = measured.measured / measured.sd;
    if (has_offset && c == 0) columns.col(1).head(samples_).setConstant(1 / measured.sd);
  }
  const Eigen::VectorXd best = columns.colPivHouseholderQr().solve(target);
  const double fallback = target.norm() / columns.col(0).norm();
  point.model.kp = best[0] > 0 ? best[0] : std::isfinite(fallback) && fallback > 0 ? fallback : 1;
  if (has_offset) point.offset_m = best[1];
}

void OutputErrorSearch::fit_dead_time(SearchPoint& point) {
  double lowest = 0;
  SearchPoint best = point;
  for (const double share : {0.02, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95}) {
    SearchPoint candidate = point;
    candidate.dead_time_s = share * options_.longest_dead_time_s;
    fit_gain(candidate);
    const double found = cost(candidate);
    if (share == 0.02 || found < lowest) best = candidate, lowest = found;
  }
  point = best;
}

double OutputErrorSearch::cost(const SearchPoint& point) {
  const auto parts = residuals(point);
  double sum = 0;
  for (std::size_t c = 0; c < parts.size(); ++c) sum += (parts[c] / measured_[c].sd).squaredNorm();
  return sum;
}

double OutputErrorSearch::absolute_cost(const SearchPoint& point) {
  const auto parts = residuals(point);
  double sum = 0;
  for (std::size_t c = 0; c < parts.size(); ++c) sum += (parts[c] / measured_[c].sd).lpNorm<1>();
  return sum;
}

SearchEnd OutputErrorSearch::descend(Structure structure, SearchPoint& point, int iteration_limit, Progress progress) {
  using Eigen::LevenbergMarquardtSpace::Running;
  Eigen::VectorXd x = coordinates(structure, point);
  Descent descent{*this, structure};
  Eigen::LevenbergMarquardt<Descent> solver(descent);
  solver.parameters.ftol = 1e-13;
  solver.parameters.xtol = 1e-11;
  solver.parameters.maxfev = 20 * (iteration_limit + 1);
  SearchEnd end = SearchEnd::converged;
  auto status = Running;
  solver.useExternalScaling = true;  // the coordinates are of order 1, and their scale must not follow the valley
  solver.diag.setOnes(x.size());
  solver.parameters.factor = 1;
  if (is_late()) return SearchEnd::time_limit;
  status = solver.minimizeInit(x);
  for (int i = 0; status == Eigen::LevenbergMarquardtSpace::NotStarted || status == Running; ++i) {
    if (i >= iteration_limit) {
      end = SearchEnd::iteration_limit;
      break;
    }
    status = solver.minimizeOneStep(x);
    ++progress.iteration;
    progress.sse = 0;
    for (std::size_t c = 0; c < measured_.size(); ++c) {
      const auto part = solver.fvec.segment(static_cast<Index>(c) * samples_, samples_);
      progress.sse += measured_[c].sd * measured_[c].sd * part.squaredNorm();
    }
    if (options_.on_progress && !options_.on_progress(progress)) {
      end = SearchEnd::cancelled;
      break;
    }
  }
  if (status == Eigen::LevenbergMarquardtSpace::UserAsked || is_late()) end = SearchEnd::time_limit;
  if (x.allFinite()) point = point_at(structure, x);
  last_iterations_ = progress.iteration;
  return end;
}

SearchResult OutputErrorSearch::run(Structure structure) {
  for (Measured& measured : measured_) {
    measured.sd = scale_of(measured.measured);
    measured.root_weight.setOnes();
  }
  SearchResult result;
  std::vector<double> costs;
  const int starts = 1 + std::max(0, options_.further_starts);
  const double rounding = kRoundingShare * kRoundingShare * static_cast<double>(samples_);
  bool is_stopped = false;
  for (int index = 0; index < starts && !is_stopped; ++index) {
    SearchPoint point = start(structure, index);
    fit_gain(point);
    if (options_.longest_dead_time_s > 0) fit_dead_time(point);
    const SearchEnd end = descend(structure, point, options_.iteration_limit, {structure, index, starts, 0, 0});
    is_stopped = end == SearchEnd::cancelled || end == SearchEnd::time_limit;
    const double found = cost(point);
    if (costs.empty() || found < *std::min_element(costs.begin(), costs.end())) {
      result.point = point;
      result.end = end;
      result.iterations = last_iterations_;
    }
    if (is_stopped) result.end = end;
    costs.push_back(found);
  }
  result.starts = static_cast<int>(costs.size());
  const double best = *std::min_element(costs.begin(), costs.end());
  result.starts_that_agree = static_cast<int>(std::count_if(
      costs.begin(), costs.end(), [&](double found) { return found <= best * (1 + kAgreement) + rounding; }));
  if (!is_stopped && measured_.size() > 1) refine_channel_weights(structure, result);
  if (!is_stopped && options_.cost == Cost::absolute_error) refine_absolute_error(structure, result);
  return result;
}

void OutputErrorSearch::refine_channel_weights(Structure structure, SearchResult& result) {
  for (int round = 0; round < kWeightRounds; ++round) {
    const auto parts = residuals(result.point);
    for (std::size_t c = 0; c < parts.size(); ++c) {
      const double floor = 1e-13 * scale_of(measured_[c].measured);
      measured_[c].sd = std::max(floor, parts[c].norm() / std::sqrt(static_cast<double>(samples_)));
    }
    result.end = descend(structure, result.point, options_.iteration_limit,
                         {structure, result.starts - 1, result.starts, result.iterations, 0});
    result.iterations = last_iterations_;
    if (result.end == SearchEnd::cancelled || result.end == SearchEnd::time_limit) return;
  }
}

// Weights 1/|r| make the squares of (1) the absolute values of (2); each round must lower (2), or is the last.
void OutputErrorSearch::refine_absolute_error(Structure structure, SearchResult& result) {
  double lowest = absolute_cost(result.point);
  result.end = SearchEnd::iteration_limit;
  SearchPoint point = result.point;
  int small_gains = 0;
  for (int round = 0; round < kReweightings; ++round) {
    const auto parts = residuals(point);
    for (std::size_t c = 0; c < parts.size(); ++c) {
      const double floor = std::max(1e-6 * parts[c].cwiseAbs().mean(), 1e-14 * measured_[c].sd);
      measured_[c].root_weight = (parts[c].cwiseAbs().cwiseMax(floor) / measured_[c].sd).cwiseSqrt().cwiseInverse();
    }
    const SearchEnd end = descend(structure, point, kIterationsPerReweighting,
                                  {structure, result.starts - 1, result.starts, result.iterations, 0});
    result.iterations = last_iterations_;
    if (end == SearchEnd::cancelled || end == SearchEnd::time_limit) result.end = end;
    const double found = absolute_cost(point);
    small_gains = found > lowest * (1 - 1e-8) ? small_gains + 1 : 0;
    if (found < lowest) lowest = found, result.point = point;
    if (result.end == SearchEnd::cancelled || result.end == SearchEnd::time_limit) return;
    if (small_gains == 3) {
      result.end = SearchEnd::converged;
      return;
    }
  }
}

}  // namespace control
