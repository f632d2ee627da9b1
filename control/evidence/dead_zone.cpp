// Projects what small duties would have made on the residuals of all runs.
#include "control/evidence/dead_zone.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <sstream>
#include <utility>

#include "control/evidence/score_columns.hpp"

namespace control {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLeastF = 60, kLeastShare = 0.1;
constexpr double kLeastOfDeadZone = 0.5, kMostOfDeadZone = 2;  // c of (1)
constexpr double kSameDuty = 1e-4;
constexpr std::size_t kMostDeadZones = 40;
constexpr Index kCommon = kParameters + 1;  // columns of C: the model's parameters and its dead time

// Between the magnitudes of the duty, where they are few; else a grid up to half of the largest.
std::vector<DeadZone> possible_dead_zones(std::span<const FittedRun> runs) {
  std::vector<double> levels;
  for (const FittedRun& run : runs) {
    for (const double value : run.recording.duty) levels.push_back(std::abs(value));
  }
  std::ranges::sort(levels);
  const auto is_same = [](double a, double b) { return b - a < kSameDuty; };
  levels.erase(std::unique(levels.begin(), levels.end(), is_same), levels.end());
  if (levels.size() > kMostDeadZones) {
    const double step = levels.back() / (2 * kMostDeadZones);
    levels.clear();
    for (std::size_t i = 0; i <= kMostDeadZones; ++i) levels.push_back(static_cast<double>(i) * step);
  }
  const std::size_t first = levels.front() < kSameDuty ? 2 : 1;
  std::vector<DeadZone> zones;
  for (std::size_t i = first; i < levels.size(); ++i) zones.push_back({levels[i - 1], levels[i]});
  return zones;
}

// The rest of one run without D_i.
struct RunLeft {
  const FittedRun* run = nullptr;
  std::vector<double> sd;  // of each channel's value
  Qr own;                  // D_i
  MatrixXd common;         // C_i
  VectorXd residual;
  Index freedom = 0;
};

std::optional<RunLeft> left_of(const FittedRun& run) {
  const auto residuals = residuals_of(run.search, run.fit, run.point);
  if (!residuals) return std::nullopt;
  const auto channels = static_cast<double>(residuals->sd.size());
  const double values_of_channel = static_cast<double>(residuals->values) / channels;
  if (!(values_of_channel > 0)) return std::nullopt;
  RunLeft left;
  left.run = &run;
  left.sd = residuals->sd;
  for (double& sd : left.sd) sd /= std::sqrt(values_of_channel);
  std::vector<MatrixXd> columns =
      own_and_disturbed(run.search, run.recording, Structure::fractional, run.point, left.sd);
  const MatrixXd slopes = std::exchange(columns.front(), MatrixXd(columns.front().rows(), 0));
  left.common = MatrixXd::Zero(slopes.rows(), kCommon);
  const std::vector<int> free = run.search.free_parameters(Structure::fractional);
  for (std::size_t j = 0; j < free.size(); ++j) {
    const auto column = slopes.col(static_cast<Index>(j));
    if (free[j] < static_cast<int>(kParameters) || free[j] == kDeadTime) {
      left.common.col(std::min<Index>(free[j], kCommon - 1)) = column;
    } else {
      columns.emplace_back(column);
    }
  }
  const MatrixXd own = side_by_side(columns);
  if (!own.allFinite() || !left.common.allFinite()) return std::nullopt;
  left.own = directions(own, 1e-9);
  left.common = beyond(left.own, left.common);
  left.residual = beyond(left.own, residuals->column * std::sqrt(values_of_channel));
  left.freedom = residuals->values - left.own.rank();
  return left;
}

// (1) of all runs that have residuals.
class DeadZoneTest {
 public:
  explicit DeadZoneTest(std::vector<RunLeft> runs) : runs_(std::move(runs)) {
    Index rows = 0, freedom = 0;
    for (const RunLeft& run : runs_) rows += run.residual.size(), freedom += run.freedom;
    MatrixXd common(rows, kCommon);
    residual_.resize(rows);
    Index row = 0;
    for (const RunLeft& run : runs_) {
      common.middleRows(row, run.residual.size()) = run.common;
      residual_.segment(row, run.residual.size()) = run.residual;
      row += run.residual.size();
    }
    common_ = directions(side_by_side({common}), 1e-9);
    residual_ = beyond(common_, residual_);
    freedom_ = static_cast<double>(freedom - common_.rank() - 1);
  }

  struct Explained {
    double share = 0, f = 0, c = 0;
  };
  // None: the parameters could make what is missing.
  std::optional<Explained> of(const DeadZone& zone) const {
    VectorXd missing(residual_.size());
    double whole = 0;
    Index row = 0;
    for (const RunLeft& run : runs_) {
      const VectorXd output = output_below(run, zone);
      if (!output.allFinite()) return std::nullopt;
      whole += output.squaredNorm();
      missing.segment(row, output.size()) = beyond(run.own, output);
      row += output.size();
    }
    missing = beyond(common_, missing);
    const double square = missing.squaredNorm();
    if (!(square > kDependent * kDependent * whole)) return std::nullopt;
    const double c = -missing.dot(residual_) / square, share = c * c * square / residual_.squaredNorm();
    return Explained{share, share / std::max(1e-12, 1 - share) * freedom_, c};
  }

 private:
  static VectorXd output_below(const RunLeft& left, const DeadZone& zone) {
    const FittedRun& run = *left.run;
    std::vector<double> below = run.recording.duty;
    const std::vector<double> driven = beyond_dead_zone(below, zone);
    for (std::size_t k = 0; k < below.size(); ++k) below[k] -= driven[k];
    return stacked(run.search.model_slopes(below, run.point), left.sd).col(0);  // by ln kp: the output itself
  }

  std::vector<RunLeft> runs_;
  Qr common_;
  VectorXd residual_;
  double freedom_ = 0;
};

}  // namespace

std::optional<DeadZone> dead_zone_evidence(std::span<const FittedRun> runs) {
  std::vector<RunLeft> left;
  for (const FittedRun& run : runs) {
    if (auto one = left_of(run)) left.push_back(std::move(*one));
  }
  if (left.empty()) return std::nullopt;
  const DeadZoneTest test{std::move(left)};
  double most = kLeastShare;
  std::optional<DeadZone> found;
  for (const DeadZone& zone : possible_dead_zones(runs)) {
    if (std::ranges::any_of(runs, [](const FittedRun& run) { return run.search.limit().end().has_value(); })) return {};
    const auto explained = test.of(zone);
    if (!explained || explained->share < most || explained->f < kLeastF) continue;
    if (explained->c < kLeastOfDeadZone || explained->c > kMostOfDeadZone) continue;
    most = explained->share;
    found = zone;
  }
  return found;
}

std::vector<double> beyond_dead_zone(std::vector<double> duty, const DeadZone& zone) {
  const double end = (zone.from_duty + zone.to_duty) / 2;
  for (double& value : duty) value = std::abs(value) < end ? 0 : value;
  return duty;
}

std::string dead_zone_in_words(const DeadZone& zone) {
  std::ostringstream text;
  text.precision(3);
  text << "the motor stands still below a duty between " << zone.from_duty << " and " << zone.to_duty
       << ": the fit takes the duties below for 0, which the model does not hold; set the robot's dead_zone_duty to "
       << zone.from_duty << " and doubtful_duty to " << zone.to_duty;
  return text.str();
}

}  // namespace control
