// The unbounded coordinates of the search, and what is known of the sensor beside its readings.
#include <algorithm>
#include <cmath>

#include "control/search/output_error_search.hpp"
#include "control/sensor/sensor_prior.hpp"

namespace control {
namespace {

using Eigen::Index;

constexpr double kNearestToBound = 1e-9;  // of the orders and the dead time, as a share of their interval
constexpr double kLargestLog = 60;        // of the gain and the coefficients, against their start in the search
constexpr double kEarliestSample = 4, kLatestSample = 2;  // A of sensor_path.hpp in ticks, before and after the tick
constexpr double kLongestTimeConstantS = 0.01;            // of the sensor: more is the fluid; a tick, if that is longer
constexpr double kClockScaleS = 0.01, kLargestClock = 50;  // of a position's clock: half a second at most

double logit(double share) { return std::log(share / (1 - share)); }

double logistic(double x) { return std::clamp(1 / (1 + std::exp(-x)), kNearestToBound, 1 - kNearestToBound); }

double inside(double share) { return std::clamp(share, kNearestToBound, 1 - kNearestToBound); }

double longest_time_constant_s(double dt_s) { return std::max(dt_s, kLongestTimeConstantS); }

}  // namespace

double OutputErrorSearch::earliest_sample_s() const { return -options_.longest_dead_time_s - kEarliestSample * dt_s_; }

Eigen::VectorXd OutputErrorSearch::coordinates(Structure structure, const SearchPoint& point) const {
  const double dead_time_share = inside(point.model.dead_time_s / options_.longest_dead_time_s);
  const FractionalModel& m = point.model;
  const SensorTiming& sensor = point.sensor;
  const double earliest_s = earliest_sample_s(), sensor_span_s = kLatestSample * dt_s_ - earliest_s;
  Eigen::VectorXd all(kPositionClock + 1);
  all << std::log(m.kp), std::log(m.b1), std::log(m.b2), logit(inside(m.alpha - 1)), logit(inside(m.beta)),
      point.offset_m / offset_scale_m_, logit(dead_time_share),
      logit(inside((sensor.first_s - earliest_s) / sensor_span_s)), (sensor.period_s / dt_s_ - 1) * record_ticks(),
      logit(inside(sensor.time_constant_s / (longest_time_constant_s(dt_s_)))), point.position_clock_s / kClockScaleS;
  return all(free_parameters(structure));
}

SearchPoint OutputErrorSearch::point_at(Structure structure, const Eigen::VectorXd& x) const {
  SearchPoint point{{1, 0, 1, 1, 2, 1}, 0, sensor_start_.sensor};
  const double earliest_s = earliest_sample_s(), sensor_span_s = kLatestSample * dt_s_ - earliest_s;
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
      case kSensorTime: point.sensor.first_s = earliest_s + logistic(value) * sensor_span_s; break;
      case kSensorPeriod: point.sensor.period_s = dt_s_ * (1 + value / record_ticks()); break;
      case kPositionClock:
        point.position_clock_s = std::clamp(value, -kLargestClock, kLargestClock) * kClockScaleS;
        break;
      case kSensorTimeConstant: point.sensor.time_constant_s = logistic(value) * longest_time_constant_s(dt_s_); break;
      default: point.model.dead_time_s = logistic(value) * options_.longest_dead_time_s;
    }
  }
  return point;
}

Eigen::VectorXd OutputErrorSearch::coordinate_slopes(Structure structure, const SearchPoint& point) const {
  const FractionalModel& m = point.model;
  const double longest_s = options_.longest_dead_time_s;
  const double earliest_s = earliest_sample_s(), sensor_span_s = kLatestSample * dt_s_ - earliest_s;
  const double time_share = (point.sensor.first_s - earliest_s) / sensor_span_s;
  const double low_pass_share = point.sensor.time_constant_s / (longest_time_constant_s(dt_s_));
  Eigen::VectorXd all(kPositionClock + 1);
  all << 1, 1, 1, (m.alpha - 1) * (2 - m.alpha), m.beta * (1 - m.beta), offset_scale_m_,
      longest_s > 0 ? point.model.dead_time_s * (1 - point.model.dead_time_s / longest_s) : 0,
      sensor_span_s * time_share * (1 - time_share), dt_s_ / record_ticks(),
      longest_time_constant_s(dt_s_) * low_pass_share * (1 - low_pass_share), kClockScaleS;
  return all(free_parameters(structure));
}

std::vector<int> OutputErrorSearch::parameters_with_prior(Structure structure) const {
  if (!sensor() || !sensor_is_found_) return {};
  const std::vector<int> free = free_parameters(structure);
  std::vector<int> places;
  for (int j = 0; j < static_cast<int>(free.size()); ++j) {
    const int parameter = free[static_cast<std::size_t>(j)];
    if (parameter < kSensorTime || parameter > kSensorTimeConstant) continue;
    if (parameter == kSensorTime && options_.longest_dead_time_s > 0) continue;  // the delay is the plant's, too
    places.push_back(j);
  }
  return places;
}

Eigen::VectorXd OutputErrorSearch::prior_residuals(Structure structure, const SearchPoint& point) const {
  const std::vector<int> free = free_parameters(structure), places = parameters_with_prior(structure);
  const SensorTiming& sensor = point.sensor;
  Eigen::VectorXd result(std::ssize(places));
  for (Index i = 0; i < result.size(); ++i) {
    switch (free[static_cast<std::size_t>(places[static_cast<std::size_t>(i)])]) {
      case kSensorTime: result[i] = (reading_lag_s(point) - options_.sensor_lag_s.value_or(0)) / kLagSdS; break;
      case kSensorPeriod: result[i] = (sensor.period_s / dt_s_ - 1) / kClockSd; break;
      default: result[i] = std::log(sensor.time_constant_s / kDataSheetTimeConstantS) / kLowPassSd;
    }
  }
  return result;
}

Eigen::MatrixXd OutputErrorSearch::prior_slopes(Structure structure, const SearchPoint& point) const {
  const std::vector<int> free = free_parameters(structure), places = parameters_with_prior(structure);
  Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(std::ssize(places), std::ssize(free));
  for (Index i = 0; i < slopes.rows(); ++i) {
    const int place = places[static_cast<std::size_t>(i)];
    switch (free[static_cast<std::size_t>(place)]) {
      case kSensorTime: slopes(i, place) = -1 / kLagSdS; break;
      case kSensorPeriod: slopes(i, place) = 1 / (dt_s_ * kClockSd); break;
      default: slopes(i, place) = 1 / (point.sensor.time_constant_s * kLowPassSd);
    }
  }
  return slopes;
}

}  // namespace control
