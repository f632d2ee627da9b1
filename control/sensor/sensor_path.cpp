// The low pass tick by tick, the samples between two ticks, and the bias by least squares.
#include "control/sensor/sensor_path.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace control {
namespace {

using Eigen::Index;

// A recovered reading has the sensor's own bias, which wanders in a minute; else the filter's, which does in seconds.
constexpr double kKnotS = 20, kKnotOfFilterS = 5;
constexpr Index kMostKnots = 100;
constexpr double kRounding = 1e-9;         // of a sample number
constexpr double kFailedReadSd = 3;        // of the model's change
constexpr double kSmallestShare = 1e-3;    // of a tick, time constant that is none
constexpr double kDifferenceShare = 1e-4;  // of a tick, for the slope by τ

Eigen::MatrixXd knots(Index samples, double duration_s, double knot_s) {
  const Index pieces = std::clamp<Index>(static_cast<Index>(std::lround(duration_s / knot_s)), 1, kMostKnots);
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(samples, pieces + 1);
  for (Index k = 0; k < samples; ++k) {
    const double place = static_cast<double>(k) / static_cast<double>(samples - 1) * static_cast<double>(pieces);
    const Index piece = std::min(pieces - 1, static_cast<Index>(place));
    result(k, piece + 1) = place - static_cast<double>(piece);
    result(k, piece) = 1 - result(k, piece + 1);
  }
  return result;
}

}  // namespace

SensorPath::SensorPath(SensorReadings readings, double dt_s, std::vector<bool> is_missed, std::vector<bool> is_left_out)
    : dt_s_(dt_s),
      reading_m_s2_(Eigen::Map<const Eigen::VectorXd>(readings.reading_m_s2.data(), std::ssize(readings.reading_m_s2))),
      is_repeated_(std::move(readings.is_repeated)),
      is_missed_(std::move(is_missed)),
      is_left_out_(std::move(is_left_out)),
      are_recovered_(readings.are_recovered),
      knots_(knots(samples(), dt_s * static_cast<double>(samples() - 1), are_recovered_ ? kKnotS : kKnotOfFilterS)) {
  bridge_missed();
  set_in_step();
}

// A straight line from reading to reading, for the search of the clock, which looks at pieces of the record.
void SensorPath::bridge_missed() {
  Index last = -1;  // tick that was read
  for (Index k = 0; k < static_cast<Index>(is_missed_.size()); ++k) {
    if (is_missed_[static_cast<std::size_t>(k)]) {
      is_repeated_[static_cast<std::size_t>(k)] = false;
      continue;
    }
    for (Index j = last + 1; last >= 0 && j < k; ++j) {
      const double share = static_cast<double>(j - last) / static_cast<double>(k - last);
      reading_m_s2_[j] = reading_m_s2_[last] + share * (reading_m_s2_[k] - reading_m_s2_[last]);
    }
    last = k;
  }
}

void SensorPath::set_in_step() {
  has_own_clock_ = false;
  order_ = {0, dt_s_};
  number_ = Eigen::VectorXd::LinSpaced(samples(), 0, static_cast<double>(samples() - 1));
  weight_ = Eigen::VectorXd::Ones(samples());
  set_weights();
}

bool SensorPath::set_order(const ReadOrder& order, double guard_s) {
  const Eigen::VectorXd before = number_;
  has_own_clock_ = true;
  order_ = order;
  weight_.setOnes();
  for (Index k = 0; k < samples(); ++k) {
    const double place = (dt_s_ * static_cast<double>(k) - order.first_available_s) / order.period_s + kRounding;
    number_[k] = std::floor(place);  // (3)
    const bool is_read_again = k > 0 && number_[k] == number_[k - 1];
    const bool is_uncertain = std::abs(place - std::round(place)) * order.period_s < guard_s;
    if (is_read_again || is_uncertain) weight_[k] = 0;
  }
  set_weights();
  return number_ != before;
}

void SensorPath::leave_out_failed_reads(const Eigen::VectorXd& expected_m_s2, double sd_m_s2) {
  for (Index k = 1; k < samples(); ++k) {
    const bool moves_on = std::abs(expected_m_s2[k] - expected_m_s2[k - 1]) > kFailedReadSd * sd_m_s2;
    if (moves_on && is_repeated_[static_cast<std::size_t>(k)]) weight_[k] = 0;
  }
  set_weights();
}

void SensorPath::set_weights() {
  for (const std::vector<bool>* uncounted : {&is_missed_, &is_left_out_}) {
    for (std::size_t k = 0; k < uncounted->size(); ++k) {
      if ((*uncounted)[k]) weight_[static_cast<Index>(k)] = 0;
    }
  }
  weighed_knots_.compute(weight_.asDiagonal() * knots_);
}

Eigen::VectorXd SensorPath::filtered(const Eigen::VectorXd& motion_m_s2, double time_constant_s) const {
  const auto a = motion_m_s2.head(samples()), mean = motion_m_s2.tail(samples());
  if (!(time_constant_s > kSmallestShare * dt_s_)) return a;
  const double turns = dt_s_ / time_constant_s, decay = std::exp(-turns), late = 1 - (1 - decay) / turns;
  const double bend = 6 * (turns - 2 + (turns + 2) * decay) / (turns * turns);  // of 6 s (1 - s), s from 0 to 1
  Eigen::VectorXd f = Eigen::VectorXd::Zero(samples());
  for (Index k = 1; k < samples(); ++k) {
    f[k] =
        decay * f[k - 1] + (1 - decay) * a[k - 1] + late * (a[k] - a[k - 1]) + bend * (mean[k] - (a[k] + a[k - 1]) / 2);
  }
  return f;
}

Eigen::VectorXd SensorPath::delayed(const Eigen::VectorXd& values) const {
  const Index kept = std::max<Index>(0, samples() - delay_ticks_);
  Eigen::VectorXd result = Eigen::VectorXd::Zero(samples());
  result.tail(kept) = values.head(kept);
  return result;
}

double SensorPath::place(Index tick, const SensorTiming& timing) const {
  return (timing.first_s + timing.period_s * number_[tick]) / dt_s_ - static_cast<double>(delay_ticks_);
}

Eigen::VectorXd SensorPath::sampled(const Eigen::VectorXd& motion_m_s2, const SensorTiming& timing) const {
  const Eigen::VectorXd f = filtered(motion_m_s2, timing.time_constant_s);
  Eigen::VectorXd result(samples());
  for (Index k = 0; k < samples(); ++k) {
    const double at = place(k, timing);
    const Index before = std::clamp<Index>(static_cast<Index>(std::floor(at)), 0, samples() - 2);
    result[k] = at < 0 ? 0 : f[before] + (at - static_cast<double>(before)) * (f[before + 1] - f[before]);
  }
  return result;
}

Eigen::MatrixXd SensorPath::timing_slopes(const Eigen::VectorXd& motion_m_s2, const SensorTiming& timing) const {
  const Eigen::VectorXd f = filtered(motion_m_s2, timing.time_constant_s);
  Eigen::MatrixXd slopes(samples(), 3);
  for (Index k = 0; k < samples(); ++k) {
    const double at = place(k, timing);
    const Index before = std::clamp<Index>(static_cast<Index>(std::floor(at)), 0, samples() - 2);
    slopes(k, 0) = at < 0 ? 0 : (f[before + 1] - f[before]) / dt_s_;
    slopes(k, 1) = slopes(k, 0) * number_[k];
  }
  SensorTiming slower = timing;
  slower.time_constant_s += kDifferenceShare * dt_s_;
  slopes.col(2) = (sampled(motion_m_s2, slower) - sampled(motion_m_s2, timing)) / (kDifferenceShare * dt_s_);
  return slopes;
}

Eigen::VectorXd SensorPath::weighed(const Eigen::VectorXd& values) const {
  const Eigen::VectorXd given = weight_.cwiseProduct(values);
  return given - weight_.cwiseProduct(knots_ * weighed_knots_.solve(given));
}

Eigen::VectorXd SensorPath::with_weight(const Eigen::VectorXd& values) const {
  Eigen::VectorXd kept(weighed_samples());
  Index count = 0;
  for (Index k = 0; k < samples(); ++k) {
    if (weight_[k] > 0) kept[count++] = values[k];
  }
  return kept;
}

Eigen::VectorXd SensorPath::bias(const Eigen::VectorXd& residual_m_s2) const {
  return knots_ * weighed_knots_.solve(weight_.cwiseProduct(residual_m_s2));
}

}  // namespace control
