// Finds how the accelerometer was read: a fit in step with the ticks first, then the sensor's own clock, if it has one.
#include <algorithm>
#include <cmath>

#include "control/search/output_error_search.hpp"
#include "control/sensor/sensor_clock.hpp"
#include "control/sensor/sensor_prior.hpp"

namespace control {
namespace {

using Eigen::Index;

constexpr double kRoughAge = 0.75;  // in ticks: half a sample period and a low pass
constexpr double kDelaysTried = 200;
constexpr double kClearlyBetter =
    30;                              // in twice the log likelihood, for a clock of three unknowns that was scanned for
constexpr double kNearLimit = 0.01;  // ticks
constexpr double kInStep = 0.1;      // ticks that the clock runs ahead or behind in the whole record
constexpr double kOldestReading = 6.5,
                 kNewestReading = -0.5;  // ticks beyond the dead time; the most of a search without
// Of each round, in ticks: how far the order of the samples is sought, and how near to a change readings do not count.
struct Round {
  double range, guard;
};
constexpr Round kRounds[] = {{0.1, 0.1}, {0.1, 0.03}, {0.03, 0.003}, {0.03, 0.003}, {0.03, 0.003}, {0.03, 0.003}};
constexpr int kRoundsAtLeast = 3;

}  // namespace

SensorTiming OutputErrorSearch::rough_timing() const { return {-kRoughAge * dt_s_, dt_s_, kDataSheetTimeConstantS}; }

double OutputErrorSearch::sensor_sd(const SearchPoint& point) {
  const double count = static_cast<double>(std::max<Index>(1, sensor()->weighed_samples()));
  return residuals(point).front().norm() / std::sqrt(count);
}

void OutputErrorSearch::set_reading_sd(double sd_m_s2) {
  reading_sd_m_s2_ = sd_m_s2;
  prior_weight_ = sd_m_s2 / measured_.front().sd;
}

void OutputErrorSearch::find_sensor() {
  SensorPath& path = *measured_.front().path;
  path.set_in_step();
  sensor_is_found_ = false;
  sensor_start_.sensor = rough_timing();
  stop_ = [this] { return limit_.is_reached(); };
  if (options_.longest_dead_time_s > 0) {
    SearchPoint point = start(Structure::fractional, 0);
    find_delay(point);
    sensor_start_.sensor = point.sensor;
  }
  SearchResult rough;
  run_starts(Structure::fractional, rough);
  if (!limit_.end() && rough.starts > 0) {
    sensor_is_found_ = true;
    const double earlier_ticks = std::floor(-rough.point.sensor.first_s / dt_s_ - kRoughAge / 2);
    path.set_delay(std::max<Index>(0, static_cast<Index>(earlier_ticks)));
    rough.point.sensor.first_s += dt_s_ * static_cast<double>(path.delay_ticks());
    set_reading_sd(sensor_sd(rough.point));
    path.leave_out_failed_reads(path.sampled(measured_.front().model.output(rough.point.model), rough.point.sensor),
                                reading_sd_m_s2_);
    descend_again(rough.point);
    const SearchPoint in_step = rough.point;
    const double sd_in_step = sensor_sd(in_step);
    const bool has_clock = !limit_.end() && find_own_clock(rough.point);
    const double gain = record_ticks() * 2 * std::log(sd_in_step / sensor_sd(rough.point));
    if (!has_clock || !(gain > kClearlyBetter)) {
      path.set_in_step();
      rough.point = in_step;
      path.leave_out_failed_reads(path.sampled(measured_.front().model.output(in_step.model), in_step.sensor),
                                  sd_in_step);
    }
    sensor_start_ = rough.point;
    set_reading_sd(sensor_sd(rough.point));
  }
  stop_ = {};
}

// Which delay of the start's output is most like the readings.
void OutputErrorSearch::find_delay(SearchPoint& point) {
  const Measured& measured = measured_.front();
  const Eigen::VectorXd output = measured.model.output(point.model);
  const Eigen::VectorXd wanted = measured.path->weighed(measured.measured);
  const double longest_s = options_.longest_dead_time_s, step_s = std::max(dt_s_ / 2, longest_s / kDelaysTried);
  double highest = 0;
  SensorTiming timing = rough_timing();
  for (double delay_s = 0; delay_s <= longest_s && !limit_.is_reached(); delay_s += step_s) {
    timing.first_s = rough_timing().first_s - delay_s;
    const Eigen::VectorXd column = measured.path->weighed(measured.path->sampled(output, timing));
    const double likeness = column.dot(wanted) / std::max(1e-200, column.norm());
    if (likeness > highest) highest = likeness, point.sensor = timing;
  }
}

bool OutputErrorSearch::descend_again(SearchPoint& point) {
  const SearchEnd end = descend(Structure::fractional, point, options_.iteration_limit, {});
  return end == SearchEnd::converged;
}

bool OutputErrorSearch::find_own_clock(SearchPoint& point) {
  Measured& measured = measured_.front();
  SensorPath& path = *measured.path;
  ReadOrder order;
  for (int round = 0; round < static_cast<int>(std::size(kRounds)); ++round) {
    const Eigen::VectorXd output = measured.model.output(point.model);
    const Eigen::VectorXd expected = path.delayed(path.filtered(output, point.sensor.time_constant_s));
    const Eigen::VectorXd rest = measured.measured - path.sampled(output, point.sensor);
    const Eigen::VectorXd readings = measured.measured - path.bias(rest);
    const double sd = sensor_sd(point);
    set_reading_sd(sd);
    const ClockEvidence evidence{dt_s_, expected, readings, path.is_repeated(), sd, stop_};
    if (round == 0) {
      const auto clock = find_clock(evidence, point.sensor.time_constant_s);
      if (!clock) return false;
      point.sensor = clock->timing;
      order = clock->order;
    }
    if (std::abs(point.sensor.period_s / dt_s_ - 1) * record_ticks() < kInStep) return false;
    order = find_order(evidence, point.sensor, order, kRounds[round].range * dt_s_);
    if (limit_.end()) return false;
    const bool is_new = path.set_order(order, kRounds[round].guard * dt_s_);
    path.leave_out_failed_reads(path.sampled(output, point.sensor), sd);
    if (!is_new && round >= kRoundsAtLeast) break;
    if (!descend_again(point) && limit_.end()) return false;
  }
  return true;
}

// Below 0 where the readings seem to come before what they measure.
double OutputErrorSearch::reading_lag_s(const SearchPoint& point) const {
  const SensorPath& path = *sensor();
  const double delay_s = dt_s_ * static_cast<double>(path.delay_ticks()) - point.sensor.first_s;
  const double age_s = path.has_own_clock() ? -path.order().first_available_s : dt_s_ / 2;  // in step: not known
  return delay_s - age_s;
}

double OutputErrorSearch::sensor_lag_s(const SearchPoint& point) const { return std::max(0.0, reading_lag_s(point)); }

void OutputErrorSearch::keep_dead_time(double dead_time_s, SearchPoint& point) const {
  if (!sensor() || !(dead_time_s > 0)) return;
  const double lag_s = reading_lag_s(point);
  const double kept_s = std::clamp(lag_s, dead_time_s + kNewestReading * dt_s_, dead_time_s + kOldestReading * dt_s_);
  point.sensor.first_s -= kept_s - lag_s;
}

// Of a recorded acceleration it is what the sensor's own lag, if that is known, does not explain.
double OutputErrorSearch::dead_time_s(const SearchPoint& point) const {
  if (!sensor()) return point.model.dead_time_s;
  if (!(options_.longest_dead_time_s > 0)) return 0;
  return std::max(0.0, sensor_lag_s(point) - options_.sensor_lag_s.value_or(0));
}

std::optional<SensorFit> OutputErrorSearch::sensor_fit(const SearchPoint& point) {
  const SensorPath* path = sensor();
  if (!path) return std::nullopt;
  const Measured& measured = measured_.front();
  const Eigen::VectorXd rest = measured.measured - path->sampled(measured.model.output(point.model), point.sensor);
  const Eigen::VectorXd bias_m_s2 = path->bias(rest);
  SensorFit fit;
  fit.readings_are_recovered = path->readings_are_recovered();
  fit.has_own_clock = path->has_own_clock();
  fit.period_s = point.sensor.period_s;
  fit.clock_off = fit.has_own_clock ? fit.period_s / dt_s_ - 1 : 0;
  fit.time_constant_s = point.sensor.time_constant_s;
  fit.delay_s = sensor_lag_s(point) + dt_s_ / 2;
  fit.delay_is_at_limit = point.sensor.first_s < earliest_sample_s() + kNearLimit * dt_s_;
  fit.bias_m_s2 = bias_m_s2.mean();
  fit.bias_range_m_s2 = bias_m_s2.maxCoeff() - bias_m_s2.minCoeff();
  fit.readings_left_out = static_cast<std::size_t>(samples_ - path->weighed_samples());
  return fit;
}

}  // namespace control
