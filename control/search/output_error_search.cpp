// Descends from each start, and weighs channels and residuals anew where the cost asks for it.
#include "control/search/output_error_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "control/search/missed_ticks.hpp"

namespace control {
namespace {

using Eigen::Index;

constexpr double kRoundingShare = 1e-9;  // residuals below this share of the signal are equal
constexpr int kWeightRounds = 3;         // of two channels
constexpr int kReweightings = 200;       // of the absolute error
constexpr int kIterationsPerReweighting = 3;
constexpr double kMeanSize = 0.8;  // of normal noise, in sds

Eigen::VectorXd ones_but_at(const std::vector<bool>& uncounted) {
  Eigen::VectorXd ones = Eigen::VectorXd::Ones(std::ssize(uncounted));
  for (std::size_t k = 0; k < uncounted.size(); ++k) ones[static_cast<Index>(k)] = uncounted[k] ? 0 : 1;
  return ones;
}

double scale_of(const Eigen::VectorXd& values) { return std::sqrt((values.array() - values.mean()).square().mean()); }

}  // namespace

OutputErrorSearch::OutputErrorSearch(const Recording& recording, const IdentificationOptions& options,
                                     SearchLimit::Clock clock)
    : options_(options),
      dt_s_(recording.dt_s),
      samples_(static_cast<Index>(recording.duty.size())),
      rows_(recording.position_time_s.empty() ? samples_ : static_cast<Index>(recording.position_time_s.size())),
      limit_(options.time_limit_s, options.on_progress, std::move(clock)) {
  const auto add = [&](Channel channel, const std::vector<double>& values) {
    if (values.empty()) return;
    const Eigen::VectorXd measured = Eigen::Map<const Eigen::VectorXd>(values.data(), rows_);
    measured_.push_back({channel,
                         OutputModel(channel, dt_s_, recording.duty, options.longest_dead_time_s, kModelTolerance),
                         measured, scale_of(measured), Eigen::VectorXd::Ones(rows_)});
    if (channel == Channel::position) offset_scale_m_ = measured_.back().sd;
    if (!recording.position_time_s.empty()) {
      measured_.back().times =
          std::make_unique<PositionTimes>(recording.position_time_s, dt_s_, recording.position_sd_m);
      measured_.back().measured = measured_.back().times->weighed(measured);
    }
  };
  add(Channel::position, recording.position_m);
  add(Channel::velocity, recording.velocity_m_s);
  if (!recording.acceleration_m_s2.empty()) {
    auto path = std::make_unique<SensorPath>(sensor_readings(recording.acceleration_m_s2), dt_s_, recording.is_missed,
                                             recording.is_left_out);
    const Eigen::VectorXd readings = path->readings();
    measured_.push_back({Channel::acceleration, OutputModel::with_means(dt_s_, recording.duty, kModelTolerance),
                         readings, scale_of(readings), Eigen::VectorXd::Ones(samples_), std::move(path)});
    sensor_start_.sensor = rough_timing();
    return;
  }
  if (!recording.position_time_s.empty()) return;
  if (const auto uncounted = uncounted_ticks(recording); !uncounted.empty()) counts_ = ones_but_at(uncounted);
  if (options.longest_dead_time_s > 0) make_scan(recording);
}

std::vector<int> OutputErrorSearch::free_parameters(Structure structure) const {
  std::vector<int> free = structure == Structure::fractional     ? std::vector<int>{0, 1, 2, 3, 4}
                          : structure == Structure::second_order ? std::vector<int>{0, 1, 2}
                                                                 : std::vector<int>{0, 2};
  if (const SensorPath* path = sensor()) {
    free.push_back(kSensorTime);
    if (path->has_own_clock()) free.push_back(kSensorPeriod);
    if (sensor_is_found_) free.push_back(kSensorTimeConstant);
    return free;
  }
  if (options_.fits_offset && measured_.front().channel == Channel::position) free.push_back(kOffset);
  if (options_.longest_dead_time_s > 0) free.push_back(kDeadTime);
  const bool has_clock = measured_.front().times != nullptr && options_.fits_position_clock;
  if (has_clock && !(options_.longest_dead_time_s > 0)) free.push_back(kPositionClock);
  return free;
}

std::vector<Channel> OutputErrorSearch::channels() const {
  std::vector<Channel> result;
  result.reserve(measured_.size());
  for (const Measured& measured : measured_) result.push_back(measured.channel);
  return result;
}

double OutputErrorSearch::spread_of(std::size_t channel) const { return scale_of(measured_[channel].measured); }

std::vector<Eigen::VectorXd> OutputErrorSearch::residuals(const SearchPoint& point) {
  std::vector<Eigen::VectorXd> result;
  for (Measured& measured : measured_) {
    ++outputs_computed_;
    if (measured.path) {
      const Eigen::VectorXd output = measured.path->sampled(measured.model.output(point.model), point.sensor);
      result.push_back(measured.path->weighed(measured.measured - output));  // (4)
      continue;
    }
    measured.model.set_delay(point.model.dead_time_s, stop_);
    const Eigen::VectorXd output = seen(measured, point, measured.model.output(point.model));
    const Eigen::VectorXd given = counts_.size() > 0 ? counts_.cwiseProduct(measured.measured) : measured.measured;
    result.emplace_back(given - output - point.offset_m * seen_offset(measured));
  }
  return result;
}

std::vector<Eigen::MatrixXd> OutputErrorSearch::jacobians(Structure structure, const SearchPoint& point) {
  const std::vector<int> free = free_parameters(structure);
  std::vector<Eigen::MatrixXd> result;
  for (Measured& measured : measured_) {
    if (!measured.path) measured.model.set_delay(point.model.dead_time_s, stop_);
    const Eigen::MatrixXd of_model = measured.model.jacobian(point.model);
    Eigen::MatrixXd of_sensor;
    if (measured.path) of_sensor = measured.path->timing_slopes(measured.model.output(point.model), point.sensor);
    Eigen::MatrixXd slopes(rows_, static_cast<Index>(free.size()));
    for (Index j = 0; j < slopes.cols(); ++j) {
      const int parameter = free[static_cast<std::size_t>(j)];
      if (parameter == kOffset) {
        slopes.col(j) = seen_offset(measured);
      } else if (parameter == kDeadTime) {
        slopes.col(j) = -seen(measured, point, measured.model.slope(point.model, stop_));
      } else if (parameter == kPositionClock) {
        const Eigen::VectorXd output = measured.model.output(point.model);
        slopes.col(j) = measured.times->weighed(measured.times->slope(output, point.position_clock_s));
      } else if (parameter >= kSensorTime) {
        slopes.col(j) = measured.path->weighed(of_sensor.col(parameter - kSensorTime));
      } else {
        slopes.col(j) = seen(measured, point, of_model.col(parameter));
      }
    }
    result.push_back(std::move(slopes));
  }
  return result;
}

Eigen::VectorXd OutputErrorSearch::seen(const Measured& measured, const SearchPoint& point,
                                        const Eigen::VectorXd& output) const {
  if (measured.times) return measured.times->weighed(measured.times->read(output, point.position_clock_s));
  if (measured.path) return measured.path->weighed(measured.path->sampled(output, point.sensor));
  return counts_.size() > 0 ? counts_.cwiseProduct(output) : output;
}

Eigen::VectorXd OutputErrorSearch::seen_offset(const Measured& measured) const {
  const Eigen::VectorXd offset = Eigen::VectorXd::Constant(rows_, measured.channel == Channel::position ? 1 : 0);
  if (counts_.size() > 0) return counts_.cwiseProduct(offset);
  return measured.times ? measured.times->weighed(offset) : offset;
}

Eigen::VectorXd OutputErrorSearch::counted(const Eigen::VectorXd& residual) const {
  if (sensor()) return sensor()->with_weight(residual);
  if (counts_.size() == 0) return residual;
  Eigen::VectorXd kept(static_cast<Index>(counts_.sum()));
  Index count = 0;
  for (Index k = 0; k < rows_; ++k) {
    if (counts_[k] > 0) kept[count++] = residual[k];
  }
  return kept;
}

double OutputErrorSearch::cost(const SearchPoint& point) {
  const auto parts = residuals(point);
  double sum = 0;
  for (std::size_t c = 0; c < parts.size(); ++c) sum += (parts[c] / measured_[c].sd).squaredNorm();
  return sum;
}

double OutputErrorSearch::absolute_cost(Structure structure, const SearchPoint& point) {
  const auto parts = residuals(point);
  double sum = 0;
  for (std::size_t c = 0; c < parts.size(); ++c) sum += (parts[c] / measured_[c].sd).lpNorm<1>();
  return sum + prior_weight_ * prior_weight_ / 2 * prior_residuals(structure, point).squaredNorm();
}

bool OutputErrorSearch::weighed_residuals(Structure structure, const SearchPoint& point, Eigen::VectorXd& residual) {
  const auto parts = residuals(point);
  if (limit_.is_reached()) return false;
  Index row = 0;
  for (std::size_t c = 0; c < parts.size(); ++c, row += rows_) {
    residual.segment(row, rows_) = parts[c].cwiseProduct(measured_[c].root_weight) / measured_[c].sd;
  }
  residual.tail(residual.size() - row) = prior_weight_ * prior_residuals(structure, point);
  return true;
}

bool OutputErrorSearch::weighed_slopes(Structure structure, const SearchPoint& point, Eigen::MatrixXd& slopes) {
  const auto parts = jacobians(structure, point);
  if (limit_.is_reached()) return false;
  const Eigen::VectorXd chain = coordinate_slopes(structure, point);
  Index row = 0;
  for (std::size_t c = 0; c < parts.size(); ++c, row += rows_) {
    const Measured& measured = measured_[c];
    slopes.middleRows(row, rows_) = (measured.root_weight / -measured.sd).asDiagonal() * parts[c] * chain.asDiagonal();
  }
  slopes.bottomRows(slopes.rows() - row) = prior_weight_ * prior_slopes(structure, point) * chain.asDiagonal();
  return true;
}

SearchEnd OutputErrorSearch::descend(Structure structure, SearchPoint& point, int iteration_limit, Progress progress,
                                     const KnownMinimum* known) {
  SquaresToMinimise squares;
  squares.values = rows_ * static_cast<Index>(measured_.size()) + prior_residuals(structure, point).size();
  squares.residuals = [&](const Eigen::VectorXd& x, Eigen::VectorXd& residual) {
    return weighed_residuals(structure, point_at(structure, x), residual);
  };
  squares.slopes = [&](const Eigen::VectorXd& x, Eigen::MatrixXd& slopes) {
    return weighed_slopes(structure, point_at(structure, x), slopes);
  };
  squares.sse = [&](const Eigen::VectorXd& residual) {
    double sum = 0;
    for (std::size_t c = 0; c < measured_.size(); ++c) {
      const auto part = residual.segment(static_cast<Index>(c) * rows_, rows_);
      sum += measured_[c].sd * measured_[c].sd * part.squaredNorm();
    }
    return sum;
  };
  const Descended found =
      control::descend(squares, coordinates(structure, point), iteration_limit, progress, limit_, known);
  last_iterations_ = found.iterations;
  last_cost_ = found.cost;
  if (found.has_begun && found.x.allFinite()) point = point_at(structure, found.x);
  return found.end;
}

SearchResult OutputErrorSearch::run(Structure structure) {
  for (Measured& measured : measured_) {
    measured.sd = scale_of(measured.measured);
    measured.root_weight.setOnes();
  }
  prior_weight_ = reading_sd_m_s2_ / measured_.front().sd;
  SearchResult result;
  stop_ = [this] { return limit_.is_reached(); };
  run_starts(structure, result);
  if (!limit_.end() && measured_.size() > 1) refine_channel_weights(structure, result);
  if (!limit_.end() && options_.cost == Cost::absolute_error) refine_absolute_error(structure, result);
  stop_ = {};
  if (limit_.end()) result.end = *limit_.end();
  if (result.starts == 0) {
    result.point = start(structure, 0);
    fit_gain(result.point);
  }
  return result;
}

void OutputErrorSearch::run_starts(Structure structure, SearchResult& result) {
  std::vector<double> costs;
  const int starts = 1 + options_.further_starts;
  const double values = static_cast<double>(rows_), rounding = kRoundingShare * kRoundingShare * values;
  double best = std::numeric_limits<double>::infinity();
  std::optional<KnownMinimum> minimum;
  for (int index = 0; index < starts; ++index) {
    const Progress progress{structure, index, starts, 0, 0};
    limit_.begin(progress);
    if (limit_.is_reached()) break;
    SearchPoint point = start(structure, index);
    fit_gain(point);
    if (options_.longest_dead_time_s > 0 && !sensor()) fit_dead_time(point);
    if (limit_.is_reached()) break;
    const SearchEnd end = descend(structure, point, options_.iteration_limit, progress, minimum ? &*minimum : nullptr);
    if (limit_.end() && last_iterations_ == 0) break;
    if (costs.empty() || last_cost_ < best) {
      best = std::min(best, last_cost_);
      result.point = point;
      result.end = end;
      result.iterations = last_iterations_;
      minimum.reset();
      if (end == SearchEnd::converged) minimum = {coordinates(structure, point), last_cost_};
    }
    costs.push_back(last_cost_);
    if (limit_.end()) break;
  }
  result.starts = static_cast<int>(costs.size());
  result.starts_that_agree = static_cast<int>(
      std::ranges::count_if(costs, [&](double found) { return costs_agree(found - rounding, best, values); }));
}

void OutputErrorSearch::refine_channel_weights(Structure structure, SearchResult& result) {
  for (int round = 0; round < kWeightRounds; ++round) {
    const auto parts = residuals(result.point);
    if (limit_.is_reached()) return;
    for (std::size_t c = 0; c < parts.size(); ++c) {
      const double floor = 1e-13 * scale_of(measured_[c].measured);
      measured_[c].sd =
          std::max(floor, counted(parts[c]).norm() / std::sqrt(static_cast<double>(counted(parts[c]).size())));
    }
    result.end = descend(structure, result.point, options_.iteration_limit,
                         {structure, result.starts - 1, result.starts, result.iterations, 0});
    result.iterations = last_iterations_;
    if (limit_.end()) return;
  }
}

// Weights 1/|r| make the squares of (1) the absolute values of (2); each round must lower (2), or is the last.
void OutputErrorSearch::refine_absolute_error(Structure structure, SearchResult& result) {
  prior_weight_ = std::sqrt(kMeanSize * reading_sd_m_s2_ / measured_.front().sd);  // (2) has no squares
  double lowest = absolute_cost(structure, result.point);
  if (limit_.is_reached()) return;
  result.end = SearchEnd::iteration_limit;
  SearchPoint point = result.point;
  int small_gains = 0;
  for (int round = 0; round < kReweightings; ++round) {
    const auto parts = residuals(point);
    if (limit_.is_reached()) return;
    for (std::size_t c = 0; c < parts.size(); ++c) {
      const double floor = std::max(1e-6 * parts[c].cwiseAbs().mean(), 1e-14 * measured_[c].sd);
      measured_[c].root_weight = (parts[c].cwiseAbs().cwiseMax(floor) / measured_[c].sd).cwiseSqrt().cwiseInverse();
    }
    const SearchEnd end = descend(structure, point, kIterationsPerReweighting,
                                  {structure, result.starts - 1, result.starts, result.iterations, 0});
    result.iterations = last_iterations_;
    if (end == SearchEnd::not_finite) result.end = end;
    if (limit_.end() || end == SearchEnd::not_finite) return;
    const double found = absolute_cost(structure, point);
    if (limit_.is_reached()) return;
    small_gains = found > lowest * (1 - 1e-8) ? small_gains + 1 : 0;
    if (found < lowest) lowest = found, result.point = point;
    if (small_gains == 3) {
      result.end = SearchEnd::converged;
      return;
    }
  }
}

}  // namespace control
