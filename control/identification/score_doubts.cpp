// Projects the residuals on what other parameters and another amplitude could make of them.
#include "control/identification/score_doubts.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "control/identification/residual_doubts.hpp"
#include "control/search/fit_statistics.hpp"

namespace control {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kDoubtfulF = 60, kDoubtfulShare = 0.1;
constexpr double kDoubtfulInputF = 5, kDoubtfulInputShare = 0.01, kSearchedInputF = 3;
constexpr double kMostLeftOfInput = 0.25;      // of F, by a dead time
constexpr double kFewestPerDirection = 10;     // values, so that this F is no chance
constexpr double kFitOfRounding = 100 - 1e-6;  // percent
constexpr double kWindowS = 1;                 // a clock that is off by 0.5 % drifts by half a sample
constexpr Index kMostWindows = 60;
constexpr double kShortestLag = 2;  // samples
constexpr double kSameDuty = 1e-4;
constexpr std::size_t kMostDeadZones = 40;
constexpr double kLeastOfDeadZone = 0.5, kMostOfDeadZone = 2;  // c of (5)
constexpr double kDependent = 1e-3;  // of a direction, what others cannot make of it, relative

// Columns of all channels, one below the other, in units of the channel's residual.
MatrixXd stacked(const std::vector<MatrixXd>& parts, const std::vector<double>& sd) {
  const Index samples = parts.front().rows();
  MatrixXd all(samples * std::ssize(parts), parts.front().cols());
  for (std::size_t c = 0; c < parts.size(); ++c) {
    all.middleRows(static_cast<Index>(c) * samples, samples) = parts[c] / sd[c];
  }
  return all;
}

// From one sample to a quarter of the record, ever further apart.
std::vector<Index> delays(Index samples) {
  std::vector<Index> all;
  for (Index delay = 1; delay <= samples / 4; delay += (delay + 1) / 2) all.push_back(delay);
  return all;
}

// An age of the readings that is another one in each window, where the sensor's clock was not found: a step here and a
// larger one there would seem to differ else.
MatrixXd ages(const MatrixXd& slopes, const std::vector<int>& free, Index window) {
  const auto at = std::ranges::find(free, static_cast<int>(kSensorTime)) - free.begin();
  const VectorXd slope = slopes.col(at);
  const Index samples = slope.size();
  MatrixXd all = MatrixXd::Zero(samples, (samples + window - 1) / window);
  for (Index k = 0; k < samples; ++k) all(k, k / window) = slope[k];
  return all;
}

// What the duty did not cause: an offset and a drift of each channel, and what a motion before the run leaves, at
// several lags.
MatrixXd motions(Index samples, Index channels) {
  std::vector<VectorXd> shapes{VectorXd::Ones(samples), VectorXd::LinSpaced(samples, -1, 1)};
  const Eigen::ArrayXd tick = Eigen::ArrayXd::LinSpaced(samples, 0, static_cast<double>(samples - 1));
  for (double lag = static_cast<double>(samples) / 4; lag > kShortestLag; lag /= 3) {
    shapes.emplace_back((-tick / lag).exp().matrix());
  }
  const Index count = std::ssize(shapes);
  MatrixXd all = MatrixXd::Zero(samples * channels, count * channels);
  for (Index c = 0; c < channels; ++c) {
    for (Index j = 0; j < count; ++j) {
      all.block(c * samples, c * count + j, samples, 1) = shapes[static_cast<std::size_t>(j)];
    }
  }
  return all;
}

// Slopes by the parameters of a structure, and what neither model nor duty did: another reading of the sensor, or a
// drift of the position.
std::vector<MatrixXd> own_and_disturbed(OutputErrorSearch& search, const Recording& recording, Structure structure,
                                        const SearchPoint& point, const std::vector<double>& sd) {
  std::vector<MatrixXd> all{stacked(search.jacobians(structure, point), sd)};
  const auto samples = static_cast<Index>(recording.duty.size());
  if (const SensorPath* path = search.sensor()) {
    const auto ticks_in_window = static_cast<Index>(std::ceil(kWindowS / recording.dt_s));
    const Index window = std::max(ticks_in_window, samples / kMostWindows + 1);
    if (!path->has_own_clock()) all.push_back(ages(all[0], search.free_parameters(structure), window));
  } else {
    MatrixXd moved = motions(all[0].rows() / std::ssize(sd), std::ssize(sd));
    if (const PositionTimes* times = search.position_times()) {
      for (Index j = 0; j < moved.cols(); ++j) moved.col(j) = times->weighed(moved.col(j));
    }
    all.push_back(std::move(moved));
  }
  return all;
}

std::vector<double> turned_to_squares(std::vector<double> values) {
  double largest = 0;
  for (const double value : values) largest = std::max(largest, std::abs(value));
  if (largest > 0) {
    for (double& value : values) value *= std::abs(value) / largest;
  }
  return values;
}

MatrixXd side_by_side(const std::vector<MatrixXd>& blocks) {
  Index columns = 0;
  for (const MatrixXd& block : blocks) columns += block.cols();
  MatrixXd all(blocks.front().rows(), columns);
  columns = 0;
  for (const MatrixXd& block : blocks) {
    all.middleCols(columns, block.cols()) = block;
    columns += block.cols();
  }
  for (Index j = 0; j < columns; ++j) {
    const double norm = all.col(j).norm();
    if (norm > 0) all.col(j) /= norm;
  }
  return all;
}

using Qr = Eigen::ColPivHouseholderQR<MatrixXd>;

Qr directions(const MatrixXd& columns, double threshold) {
  Qr qr;
  qr.setThreshold(threshold);
  qr.compute(columns);
  return qr;
}

// The part of each column that the directions cannot make.
MatrixXd beyond(const Qr& qr, const MatrixXd& columns) {
  MatrixXd turned = qr.householderQ().transpose() * columns;
  turned.topRows(qr.rank()).setZero();
  return qr.householderQ() * turned;
}

struct Residuals {
  std::vector<double> sd;  // of each channel, in which all columns are
  VectorXd column;
  Index values = 0;  // that count
};

// None: they are rounding, or the search was cut off.
std::optional<Residuals> residuals_of(OutputErrorSearch& search, const Fit& fit, const SearchPoint& point) {
  const bool is_rounding = fit.fit_percent >= kFitOfRounding;
  if (is_rounding || (fit.end != SearchEnd::converged && fit.end != SearchEnd::iteration_limit) || search.limit().end())
    return std::nullopt;
  if (fit.sensor && fit.sensor->delay_is_at_limit) return std::nullopt;  // what it lacks follows the steps of the duty
  Residuals residuals;
  if (search.sensor()) residuals.values = -search.sensor()->bias_terms();
  std::vector<MatrixXd> columns;
  for (const VectorXd& residual : search.residuals(point)) {
    residuals.sd.push_back(std::max(1e-200, residual.norm()));
    residuals.values += search.counted(residual).size();
    columns.emplace_back(residual);
  }
  residuals.column = stacked(columns, residuals.sd);
  return residuals;
}

struct Explained {
  double share = 0, f = 0;  // (3) and (4)
  double directions = 0;    // of `further`, beyond `known`
  double freedom = 0;
  double colour = 1;  // values per independent one, of what is left
};

// The part of the residuals that `further` explains of what `known` leaves.
std::optional<Explained> explained_by(const Residuals& residuals, const MatrixXd& known, const MatrixXd& further) {
  if (!known.allFinite() || !further.allFinite()) return std::nullopt;
  const Qr by_known = directions(known, 1e-9);
  const VectorXd residual = beyond(by_known, residuals.column);
  const Qr by_further = directions(beyond(by_known, further), kDependent);
  if (by_further.rank() == 0 || by_further.maxPivot() < kDependent) return std::nullopt;
  const VectorXd rest = beyond(by_further, residual);
  const double explained = residual.squaredNorm() - rest.squaredNorm();
  const double freedom = static_cast<double>(residuals.values - by_known.rank() - by_further.rank());
  if (!(freedom > 0)) return std::nullopt;
  const auto directions_more = static_cast<double>(by_further.rank());
  return Explained{.share = explained / residual.squaredNorm(),
                   .f = explained / rest.squaredNorm() * freedom / directions_more,
                   .directions = directions_more,
                   .freedom = freedom,
                   .colour = samples_per_independent_one(rest)};
}

// Between the magnitudes of the duty, where they are few; else a grid up to half of the largest.
std::vector<DeadZone> possible_dead_zones(const std::vector<double>& duty) {
  std::vector<double> levels;
  levels.reserve(duty.size());
  for (const double value : duty) levels.push_back(std::abs(value));
  std::ranges::sort(levels);
  const auto is_same = [](double a, double b) { return b - a < kSameDuty; };
  levels.erase(std::unique(levels.begin(), levels.end(), is_same), levels.end());
  if (levels.size() > kMostDeadZones) {
    const double step = levels.back() / (2 * kMostDeadZones);
    levels.clear();
    for (std::size_t i = 0; i <= kMostDeadZones; ++i) levels.push_back(static_cast<double>(i) * step);
  }
  std::vector<DeadZone> zones;
  for (std::size_t i = 2; i < levels.size(); ++i) zones.push_back({levels[i - 1], levels[i]});
  return zones;
}

double widening_by(double share, const Residuals& residuals, const Fit& fit) {
  return std::sqrt(1 + share * static_cast<double>(residuals.values) / std::max(1, fit.free_parameters));
}

}  // namespace

std::optional<ScoreEvidence> amplitude_evidence(OutputErrorSearch& search, const Recording& recording, const Fit& fit,
                                                const SearchPoint& point) {
  const auto residuals = residuals_of(search, fit, point);
  if (!residuals) return std::nullopt;
  const std::vector<double>& sd = residuals->sd;
  const std::vector<double> velocity_m_s = search.model_velocity_m_s(point);  // late by the dead time already
  SearchPoint prompt = point;
  prompt.model.dead_time_s = 0;
  std::vector<MatrixXd> linear = own_and_disturbed(search, recording, Structure::fractional, point, sd);
  const auto samples = static_cast<Index>(recording.duty.size());
  if (!search.sensor()) linear.push_back(stacked(search.late_outputs(delays(samples), point), sd));
  const MatrixXd changing = side_by_side({stacked(search.model_slopes(turned_to_squares(recording.duty), point), sd),
                                          stacked(search.model_slopes(turned_to_squares(velocity_m_s), prompt), sd)});
  const auto found = explained_by(*residuals, side_by_side(linear), changing);
  if (!found) return std::nullopt;
  return ScoreEvidence{found->share, found->f, widening_by(found->share, *residuals, fit)};
}

std::optional<ScoreEvidence> input_evidence(OutputErrorSearch& search, const Recording& recording, const Fit& fit,
                                            const SearchPoint& point) {
  const auto residuals = residuals_of(search, fit, point);
  if (!residuals) return std::nullopt;
  const auto samples = static_cast<Index>(recording.duty.size());
  const MatrixXd own = side_by_side(own_and_disturbed(search, recording, fit.structure, point, residuals->sd));
  const MatrixXd late = side_by_side({stacked(search.late_outputs(delays(samples), point), residuals->sd)});
  const auto found = explained_by(*residuals, own, late);
  if (!found || found->freedom < kFewestPerDirection * found->directions) return std::nullopt;
  const double by_chance = found->colour * found->directions / static_cast<double>(residuals->values);
  return ScoreEvidence{found->share, found->f / found->colour,
                       widening_by(std::max(0.0, found->share - by_chance), *residuals, fit)};
}

std::vector<double> beyond_dead_zone(std::vector<double> duty, const DeadZone& zone) {
  const double end = (zone.from_duty + zone.to_duty) / 2;
  for (double& value : duty) value = std::abs(value) < end ? 0 : value;
  return duty;
}

std::optional<DeadZone> dead_zone_evidence(OutputErrorSearch& search, const Recording& recording, const Fit& fit,
                                           const SearchPoint& point) {
  const auto residuals = residuals_of(search, fit, point);
  if (!residuals) return std::nullopt;
  const MatrixXd own = side_by_side(own_and_disturbed(search, recording, Structure::fractional, point, residuals->sd));
  if (!own.allFinite()) return std::nullopt;
  const Qr by_own = directions(own, 1e-9);
  const VectorXd left = beyond(by_own, residuals->column);
  const double freedom = static_cast<double>(residuals->values - by_own.rank() - 1);
  double most = kDoubtfulShare;
  std::optional<DeadZone> found;
  for (const DeadZone& zone : possible_dead_zones(recording.duty)) {
    if (search.limit().end()) return std::nullopt;
    std::vector<double> below = recording.duty;
    const std::vector<double> driven = beyond_dead_zone(recording.duty, zone);
    for (std::size_t k = 0; k < below.size(); ++k) below[k] -= driven[k];
    const MatrixXd slopes = stacked(search.model_slopes(below, point), residuals->sd);
    if (!slopes.allFinite()) continue;
    const VectorXd missing = beyond(by_own, slopes.leftCols(1));  // by ln kp: the output itself
    const double square = missing.squaredNorm();
    if (!(square > kDependent * kDependent * slopes.col(0).squaredNorm())) continue;
    const double c = -missing.dot(left) / square, share = c * c * square / left.squaredNorm();
    const double f = share / std::max(1e-12, 1 - share) * freedom;
    if (share < most || f < kDoubtfulF || c < kLeastOfDeadZone || c > kMostOfDeadZone) continue;
    most = share;
    found = zone;
  }
  return found;
}

bool changes_with_amplitude(const std::optional<ScoreEvidence>& evidence) {
  return evidence && evidence->f > kDoubtfulF && evidence->share >= kDoubtfulShare;
}

bool follows_input(const std::optional<ScoreEvidence>& evidence) {
  return evidence && evidence->f > kDoubtfulInputF && evidence->share >= kDoubtfulInputShare;
}

bool may_lack_dead_time(const std::optional<ScoreEvidence>& input) { return input && input->f > kSearchedInputF; }

bool is_settled_by_dead_time(const std::optional<ScoreEvidence>& left, const std::optional<ScoreEvidence>& before) {
  if (!may_lack_dead_time(left)) return true;
  return before && left->f < kMostLeftOfInput * before->f;
}

std::string dead_zone_in_words(const DeadZone& zone) {
  std::ostringstream text;
  text.precision(3);
  text << "the motor stands still below a duty between " << zone.from_duty << " and " << zone.to_duty
       << ": the fit takes the duties below for 0, which the model does not hold; set the robot's dead_zone_duty to "
       << zone.from_duty << " and doubtful_duty to " << zone.to_duty;
  return text.str();
}

std::vector<std::string> amplitude_doubts(const std::optional<ScoreEvidence>& evidence, const Recording& recording,
                                          bool order_is_forced, const std::string& structure_option) {
  if (!changes_with_amplitude(evidence)) return {};
  double largest = 0;
  for (const double duty : recording.duty) largest = std::max(largest, std::abs(duty));
  std::ostringstream text;
  text.precision(3);
  text << (order_is_forced ? "the parameters seem to change with amplitude, which they need not: "
                           : "the parameters change with amplitude: ")
       << "ones that follow duty and speed explain " << 100 * evidence->share
       << " % of what the model leaves (F = " << evidence->f << ", above " << kDoubtfulF << "): ";
  if (order_is_forced) {
    text << "the likelier reason is that its order was forced and is too low; identify without "
         << (structure_option.empty() ? "a structure that is given" : structure_option)
         << ", and see whether this doubt remains";
  } else {
    text << "no linear model holds from rest to duty " << largest
         << "; fit runs of one amplitude each, and use a fit near its amplitude only";
  }
  return {text.str()};
}

std::vector<std::string> input_doubts(const std::optional<ScoreEvidence>& evidence,
                                      const std::optional<ScoreEvidence>& amplitude,
                                      const IdentificationOptions& options) {
  if (!follows_input(evidence) || changes_with_amplitude(amplitude)) return {};
  const auto option = [](const std::string& name) { return name.empty() ? name : " (" + name + ")"; };
  std::ostringstream text;
  text.precision(3);
  text << "the residuals follow the duty: another linear model would explain " << 100 * evidence->share
       << " % of what this one leaves (F = " << evidence->f << ", above " << kDoubtfulInputF << "); ";
  if (options.structure && *options.structure != Structure::fractional) {
    text << "identify without a structure that is given" << option(options.names.structure) << ", or ";
  }
  text << (options.longest_dead_time_s > 0 ? "look for columns that are shifted in time, or a dead zone of the motor"
                                           : "search for a dead time" + option(options.names.dead_time));
  return {text.str()};
}

}  // namespace control
