// Fits the run again with a sign turned or with the offset, and looks for a motion that the duty did not cause.
#include "control/second_opinions.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <utility>

#include "control/fit_statistics.hpp"
#include "control/fit_summary.hpp"
#include "control/residual_doubts.hpp"

namespace control {
namespace {

using Eigen::Index;

constexpr double kLookForSignPercent = 80;  // below this fit
constexpr double kClearlyLowerAic = 10;
constexpr double kMotionSigmas = 5, kMotionShare = 0.01;  // of v0, and of the squares that it explains

double lowest_percent(const Recording& recording, const Fit& fit) {
  return std::min(fit_percent(fit.position_residual_m, recording.position_m),
                  fit_percent(fit.velocity_residual_m_s, recording.velocity_m_s));
}

std::optional<Fit> fit_again(const OutputErrorSearch& search, const Recording& recording, IdentificationOptions options,
                             Structure structure) {
  options.further_starts = 0;
  options.time_limit_s = search.limit().left_s();
  if (!(options.time_limit_s > 0)) return std::nullopt;
  OutputErrorSearch other(recording, options);
  const SearchResult found = other.run(structure);
  if (found.end != SearchEnd::converged) return std::nullopt;
  return summary(other, recording, options.cost, structure, found);
}

void add_turned_sign(const OutputErrorSearch& search, const Recording& recording, const IdentificationOptions& options,
                     const Fit& fit, std::vector<std::string>& warnings) {
  const double percent = lowest_percent(recording, fit);
  if (!(percent < kLookForSignPercent)) return;
  const bool has_both = !recording.position_m.empty() && !recording.velocity_m_s.empty();
  std::vector<std::pair<std::string, Recording>> turned{{"the duty (or of all that was measured)", recording}};
  for (double& duty : turned[0].second.duty) duty = -duty;
  if (has_both) {
    turned.insert(turned.end(), {{"position_m", recording}, {"velocity_m_s", recording}});
    for (double& x : turned[1].second.position_m) x = -x;
    for (double& v : turned[2].second.velocity_m_s) v = -v;
  }
  for (const auto& [name, other] : turned) {
    const auto found = fit_again(search, other, options, fit.structure);
    if (!found) continue;
    const double better = lowest_percent(other, *found);
    if (!(100 - better < (100 - percent) / 2)) continue;
    std::ostringstream text;
    text.precision(3);
    text << "with the sign of " << name << " turned round the model explains " << better << " % instead of " << percent
         << " %: the best gain is negative, and motion must follow the duty; turn one sign";
    warnings.push_back(text.str());
    return;
  }
}

void add_missing_offset(const OutputErrorSearch& search, const Recording& recording, IdentificationOptions options,
                        const Fit& fit, std::vector<std::string>& warnings) {
  if (options.fits_offset || recording.position_m.empty()) return;
  options.fits_offset = true;
  const auto with_offset = fit_again(search, recording, options, fit.structure);
  if (!with_offset || !(with_offset->aic < fit.aic - kClearlyLowerAic)) return;
  std::ostringstream text;
  text.precision(3);
  text << "position_m begins at " << with_offset->offset_m
       << " m, and this offset is not fitted: the parameters make up for it; fitting it lowers the residual sd from "
       << fit.residual_sd << " to " << with_offset->residual_sd << " m, so fit the offset too (fits_offset)";
  warnings.push_back(text.str());
}

// Residuals, their slopes and the response to an initial velocity of 1 m/s, of all channels, in units of their sd.
struct Stacked {
  Eigen::VectorXd residual, motion;
  Eigen::MatrixXd slopes;
  double per_independent_one = 1;  // samples, in the channel that is worst
};

Stacked stacked(OutputErrorSearch& search, const Recording& recording, const Fit& fit) {
  const SearchPoint point{fit.model, fit.offset_m, fit.dead_time_s};
  const auto residuals = search.residuals(point);
  const auto jacobians = search.jacobians(fit.structure, point);
  const auto channels = search.channels();
  const Index samples = static_cast<Index>(recording.duty.size()), rows = samples * std::ssize(channels);
  const double record_s = recording.dt_s * static_cast<double>(samples);
  const double lag_s = std::clamp(std::pow(fit.model.b2, 1 / fit.model.beta), 2 * recording.dt_s, record_s / 4);
  Stacked all{Eigen::VectorXd(rows), Eigen::VectorXd(rows), Eigen::MatrixXd(rows, jacobians.front().cols())};
  const Eigen::ArrayXd decay =
      (Eigen::ArrayXd::LinSpaced(samples, 0, static_cast<double>(samples - 1)) * (-recording.dt_s / lag_s)).exp();
  for (std::size_t c = 0; c < channels.size(); ++c) {
    const Index row = static_cast<Index>(c) * samples;
    const double sd = std::max(1e-200, residuals[c].norm() / std::sqrt(static_cast<double>(samples)));
    all.residual.segment(row, samples) = residuals[c] / sd;
    all.slopes.middleRows(row, samples) = jacobians[c] / sd;
    const bool is_position = channels[c] == Channel::position;
    all.motion.segment(row, samples) = (is_position ? lag_s * (1 - decay) : decay) / sd;
    all.per_independent_one = std::max(all.per_independent_one, samples_per_independent_one(residuals[c]));
  }
  return all;
}

void add_initial_motion(OutputErrorSearch& search, const Recording& recording, const Fit& fit,
                        std::vector<std::string>& warnings) {
  if (!(lowest_percent(recording, fit) < 100 - 1e-6)) return;  // rounding
  const Stacked all = stacked(search, recording, fit);
  if (!all.slopes.allFinite() || !all.motion.allFinite() || !all.residual.allFinite()) return;
  const Eigen::VectorXd scale = all.slopes.colwise().norm().transpose().cwiseMax(1e-300).cwiseInverse();
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(all.slopes * scale.asDiagonal());
  const Eigen::VectorXd own = all.motion - all.slopes * (scale.asDiagonal() * qr.solve(all.motion));
  const double size = own.squaredNorm(), along = own.dot(all.residual);
  if (!(size > 1e-8 * all.motion.squaredNorm())) return;
  const double sigmas = std::abs(along) / std::sqrt(size * all.per_independent_one);
  const double share = along * along / size / all.residual.squaredNorm();
  if (!(sigmas > kMotionSigmas && share > kMotionShare)) return;
  std::ostringstream text;
  text.precision(2);
  text << "the run seems to begin in motion, at about " << along / size << " m/s (" << sigmas
       << " sigmas): the model is at rest before the first sample; begin the record at rest";
  warnings.push_back(text.str());
}

}  // namespace

std::vector<std::string> second_opinions(OutputErrorSearch& search, const Recording& recording,
                                         const IdentificationOptions& options, const Fit& fit) {
  std::vector<std::string> warnings;
  if (fit.end != SearchEnd::converged || search.limit().end()) return warnings;
  add_turned_sign(search, recording, options, fit, warnings);
  if (!warnings.empty()) return warnings;
  add_missing_offset(search, recording, options, fit, warnings);
  add_initial_motion(search, recording, fit, warnings);
  return warnings;
}

}  // namespace control
