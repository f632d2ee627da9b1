// Projects the residuals on what other parameters and another amplitude could make of them.
#include "control/evidence/score_doubts.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "control/evidence/score_columns.hpp"
#include "control/search/fit_statistics.hpp"

namespace control {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kDoubtfulF = 60, kDoubtfulShare = 0.1;
constexpr double kDoubtfulInputF = 5, kDoubtfulInputShare = 0.01, kSearchedInputF = 3;
constexpr double kMostLeftOfInput = 0.25;   // of F, by a dead time
constexpr double kFewestPerDirection = 10;  // values, so that this F is no chance

// From one sample to a quarter of the record, ever further apart.
std::vector<Index> delays(Index samples) {
  std::vector<Index> all;
  for (Index delay = 1; delay <= samples / 4; delay += (delay + 1) / 2) all.push_back(delay);
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

bool changes_with_amplitude(const std::optional<ScoreEvidence>& evidence) {
  return evidence && evidence->f > kDoubtfulF && evidence->share >= kDoubtfulShare;
}

bool follows_input(const std::optional<ScoreEvidence>& evidence) {
  return evidence && evidence->f > kDoubtfulInputF && evidence->share >= kDoubtfulInputShare;
}

bool may_lack_dead_time(const std::optional<ScoreEvidence>& input) { return input && input->f > kSearchedInputF; }

bool is_settled_by_dead_time(const std::optional<ScoreEvidence>& left, const std::optional<ScoreEvidence>& before) {
  if (!left) return false;
  return !may_lack_dead_time(left) || (before && left->f < kMostLeftOfInput * before->f);
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
