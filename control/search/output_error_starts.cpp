// Where the descents begin: the models, their best gains, and the dead time that suits them.
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "control/search/output_error_search.hpp"
#include "control/sensor/sensor_prior.hpp"

namespace control {
namespace {

using Eigen::Index;

constexpr std::size_t kScanSamples = 4000;   // of the piece on which dead times are tried
constexpr std::size_t kFewestSamples = 100;  // of the piece
constexpr double kScanDeadTimes = 4;         // the length of the piece, at least, in longest dead times
constexpr double kAgesTried = 0.3;           // ticks, either way
constexpr double kLowPassesTried = 0.7;      // of the data sheet's: from half of it to twice
constexpr double kClocksTried = 0.1;         // ticks over the whole record, either way

// 1/2, 1/4, 3/4, 1/8, 5/8, ... for 1, 2, ...: spread evenly however many are taken.
double spread(int index) {
  double value = 0, place = 0.5;
  for (; index > 0; index /= 2, place /= 2) value += place * (index % 2);
  return value;
}

// From the first sample with a duty on: before it the robot rests, whatever the model. Each duty is the mean of those
// it stands for, so that its integral is right.
Recording short_piece(const Recording& recording, double longest_dead_time_s) {
  const auto moves = std::ranges::find_if(recording.duty, [](double duty) { return duty != 0; });
  const auto first = static_cast<std::size_t>(moves - recording.duty.begin());
  const std::size_t after_it = recording.duty.size() - first;
  const double wanted = std::ceil(kScanDeadTimes * longest_dead_time_s / recording.dt_s);
  const auto length = std::min(after_it, std::max(kScanSamples, static_cast<std::size_t>(wanted)));
  const std::size_t every = (length + kScanSamples - 1) / kScanSamples;
  Recording piece;
  piece.dt_s = recording.dt_s * static_cast<double>(every);
  for (std::size_t k = first; k + every <= first + length; k += every) {
    double sum = 0;
    for (std::size_t j = k; j < k + every; ++j) sum += recording.duty[j];
    piece.duty.push_back(sum / static_cast<double>(every));
    if (!recording.position_m.empty()) piece.position_m.push_back(recording.position_m[k]);
    if (!recording.velocity_m_s.empty()) piece.velocity_m_s.push_back(recording.velocity_m_s[k]);
  }
  return piece;
}

}  // namespace

// What the sensor was found with, if there is one; the Newtonian model, a hair inside the bounds; then lags spread over
// what the record can show.
SearchPoint OutputErrorSearch::start(Structure structure, int index) const {
  if (sensor_is_found_ && structure == Structure::fractional && index-- == 0) return sensor_start_;
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
  return {model, 0, sensor_start(index)};
}

// The sensor's age, low pass and clock vary from start to start, as the model does.
SensorTiming OutputErrorSearch::sensor_start(int index) const {
  SensorTiming timing = sensor_start_.sensor;
  if (index == 0 || !sensor()) return timing;
  timing.first_s += kAgesTried * dt_s_ * (2 * spread(5 * index + 2) - 1);
  timing.time_constant_s = kDataSheetTimeConstantS * std::exp(kLowPassesTried * (2 * spread(7 * index + 3) - 1));
  if (sensor()->has_own_clock()) {
    timing.period_s += kClocksTried * dt_s_ * (2 * spread(3 * index + 2) - 1) / record_ticks();
  }
  return timing;
}

bool OutputErrorSearch::fit_gain(SearchPoint& point) {
  point.model.kp = 1;
  const bool has_offset = options_.fits_offset && measured_.front().channel == Channel::position;
  const Index count = static_cast<Index>(measured_.size());
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(rows_ * count, has_offset ? 2 : 1);
  Eigen::VectorXd target(rows_ * count);
  for (Index c = 0; c < count; ++c) {
    Measured& measured = measured_[static_cast<std::size_t>(c)];
    ++outputs_computed_;
    if (!measured.path && !measured.model.set_delay(point.model.dead_time_s, stop_)) return false;
    columns.col(0).segment(c * rows_, rows_) = seen(measured, point, measured.model.output(point.model)) / measured.sd;
    Eigen::VectorXd wanted = measured.path ? measured.path->weighed(measured.measured) : measured.measured;
    if (counts_.size() > 0) wanted = wanted.cwiseProduct(counts_);
    target.segment(c * rows_, rows_) = wanted / measured.sd;
    if (has_offset && c == 0) columns.col(1).head(rows_) = seen_offset(measured) / measured.sd;
  }
  const Eigen::VectorXd best = columns.colPivHouseholderQr().solve(target);
  const double fallback = target.norm() / columns.col(0).norm();
  point.model.kp = best[0] > 0 ? best[0] : std::isfinite(fallback) && fallback > 0 ? fallback : 1;
  if (has_offset) point.offset_m = std::isfinite(best[1]) ? best[1] : 0;
  return best[0] > 0;
}

void OutputErrorSearch::fit_dead_time(SearchPoint& point) {
  OutputErrorSearch& scan = scan_ ? *scan_ : *this;
  double lowest = 0;
  SearchPoint best = point;
  for (const double share : {0.02, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95}) {
    if (limit_.is_reached()) return;
    SearchPoint candidate = point;
    candidate.model.dead_time_s = share * options_.longest_dead_time_s;
    scan.fit_gain(candidate);
    const double found = scan.cost(candidate);
    if (share == 0.02 || found < lowest) best = candidate, lowest = found;
  }
  point = best;
  if (scan_) fit_gain(point);
}

void OutputErrorSearch::make_scan(const Recording& recording) {
  if (recording.duty.size() <= kScanSamples) return;
  const Recording piece = short_piece(recording, options_.longest_dead_time_s);
  if (piece.duty.size() < kFewestSamples) return;
  IdentificationOptions options = options_;
  options.on_progress = {};
  scan_ = std::make_unique<OutputErrorSearch>(piece, options);
  for (std::size_t c = 0; c < measured_.size(); ++c) scan_->measured_[c].sd = measured_[c].sd;
}

}  // namespace control
