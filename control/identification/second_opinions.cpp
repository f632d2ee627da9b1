// Fits the run again with a sign turned or with the offset, and looks for a motion that the duty did not cause.
#include "control/identification/second_opinions.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <utility>

#include "base/invalid_argument.hpp"
#include "control/evidence/score_doubts.hpp"
#include "control/identification/fit_summary.hpp"
#include "control/identification/residual_doubts.hpp"
#include "control/search/fit_statistics.hpp"
#include "control/search/missed_ticks.hpp"
#include "control/sensor/sensor_prior.hpp"

namespace control {
namespace {

using Eigen::Index;

constexpr double kLookForSignPercent = 80;  // below this fit
constexpr double kClearlyLowerAic = 10;
constexpr std::ptrdiff_t kFewest = 20;                    // samples of the beginning
constexpr double kRoughBeginning = 3;                     // times the size of the other residuals, by the medians
constexpr double kNoticeableLagS = 0.002;                 // twice what the age of the samples is known to
constexpr double kLagsOfTheSensor = 2;                    // sds of its own lag that a delay is not called a dead time
constexpr double kAsSmall = 1.02;                         // of residuals, relative
constexpr double kMotionSigmas = 5, kMotionShare = 0.01;  // of v0, and of the squares that it explains
constexpr double kNoticeableRows = 0.3;                   // of a duty that is shifted, to first order

std::string in_brackets(const std::string& option) { return option.empty() ? option : " (" + option + ")"; }

double lowest_percent(const OutputErrorSearch& search, const Recording& recording, const Fit& fit) {
  return std::min({fit_percent(search, fit.position_residual_m, recording.position_m, recording.position_sd_m),
                   fit_percent(search, fit.velocity_residual_m_s, recording.velocity_m_s),
                   fit_percent(search, fit.acceleration_residual_m_s2, recording.acceleration_m_s2)});
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
  const double percent = lowest_percent(search, recording, fit);
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
    const double better = lowest_percent(search, other, *found);
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
       << fit.residual_sd << " to " << with_offset->residual_sd << " m, so fit the offset too"
       << in_brackets(options.names.offset);
  warnings.push_back(text.str());
}

// Residuals and slopes of all channels, of the values that count, in units of the channel's sd.
struct Stacked {
  Eigen::VectorXd residual;
  Eigen::MatrixXd slopes;
  std::vector<Channel> channels;
  std::vector<double> sd;
  Eigen::ArrayXd tick;  // of each value of a channel
};

Stacked stacked(OutputErrorSearch& search, const Recording& recording, const Fit& fit) {
  const SearchPoint point{fit.model, fit.offset_m};
  const auto residuals = search.residuals(point);
  const auto jacobians = search.jacobians(fit.structure, point);
  const Index ticks = static_cast<Index>(recording.duty.size());
  const Eigen::VectorXd tick = search.counted(Eigen::VectorXd::LinSpaced(ticks, 0, static_cast<double>(ticks - 1)));
  const Index values = tick.size(), rows = values * std::ssize(residuals);
  Stacked all{Eigen::VectorXd(rows), Eigen::MatrixXd(rows, jacobians.front().cols()), search.channels(), {}, tick};
  for (std::size_t c = 0; c < residuals.size(); ++c) {
    const Index row = static_cast<Index>(c) * values;
    all.sd.push_back(std::max(1e-200, residuals[c].norm() / std::sqrt(static_cast<double>(values))));
    all.residual.segment(row, values) = search.counted(residuals[c]) / all.sd[c];
    for (Index j = 0; j < all.slopes.cols(); ++j) {
      all.slopes.col(j).segment(row, values) = search.counted(jacobians[c].col(j)) / all.sd[c];
    }
  }
  return all;
}

// To an initial velocity of 1 m/s.
Eigen::VectorXd response_to_motion(const Stacked& all, double dt_s, double lag_s) {
  const Index values = all.tick.size();
  const Eigen::ArrayXd decay = (all.tick * (-dt_s / lag_s)).exp();
  Eigen::VectorXd response(all.residual.size());
  for (std::size_t c = 0; c < all.channels.size(); ++c) {
    auto part = response.segment(static_cast<Index>(c) * values, values);
    if (all.channels[c] == Channel::position) {
      part = lag_s * (1 - decay) / all.sd[c];
    } else {
      part = decay / all.sd[c];
    }
  }
  return response;
}

struct InitialMotion {
  double velocity_m_s = 0, sigmas = 0, share = 0;
  Eigen::VectorXd bent = {};  // by how much the slopes' parameters have bent to it, to first order
};

InitialMotion motion_with_lag(const Stacked& all, const Eigen::ColPivHouseholderQR<Eigen::MatrixXd>& qr, double dt_s,
                              double lag_s) {
  const Eigen::VectorXd motion = response_to_motion(all, dt_s, lag_s);
  const Eigen::VectorXd like_motion = qr.solve(motion), own = motion - all.slopes * like_motion;
  const double size = own.squaredNorm();
  if (!(size > 1e-8 * motion.squaredNorm())) return {};
  const double velocity_m_s = own.dot(all.residual) / size;
  const Eigen::VectorXd rest = all.residual - velocity_m_s * own;
  const Index values = all.tick.size();
  double per_independent_one = 1;
  for (Index row = 0; row < rest.size(); row += values) {
    per_independent_one = std::max(per_independent_one, samples_per_independent_one(rest.segment(row, values)));
  }
  const double sd = std::sqrt(rest.squaredNorm() / static_cast<double>(rest.size()) * per_independent_one / size);
  return {velocity_m_s, std::abs(velocity_m_s) / std::max(1e-300, sd),
          1 - rest.squaredNorm() / all.residual.squaredNorm(), velocity_m_s * like_motion};
}

// What a flexible model has bent itself to, (1) no longer shows; but its first samples then fit worse than the rest.
void add_rough_beginning(const Recording& recording, const Fit& fit, std::vector<std::string>& warnings) {
  const auto& residual = recording.position_m.empty() ? fit.velocity_residual_m_s : fit.position_residual_m;
  const std::vector<bool> uncounted = uncounted_ticks(recording);
  std::vector<double> size, end_s;  // of what counts
  for (std::size_t k = 0; k < residual.size(); ++k) {
    if (!uncounted.empty() && uncounted[k]) continue;
    size.push_back(std::abs(residual[k]));
    end_s.push_back(recording.dt_s * static_cast<double>(k + 1));
  }
  const double in_a_second = std::min(1 / recording.dt_s, static_cast<double>(size.size()) / 4);
  for (const std::ptrdiff_t first : {kFewest, static_cast<std::ptrdiff_t>(in_a_second)}) {
    if (first < kFewest || 2 * first > std::ssize(size)) continue;
    const double ratio = median({size.begin(), size.begin() + first}) / median({size.begin() + first, size.end()});
    if (!(ratio > kRoughBeginning) || !std::isfinite(ratio)) continue;
    std::ostringstream text;
    text.precision(2);
    text << "the first " << end_s[static_cast<std::size_t>(first - 1)] << " s fit " << ratio
         << " times worse than the rest: the run seems to begin in motion, or shows fast terms that the model lacks; "
            "begin the record at rest";
    warnings.push_back(text.str());
    return;
  }
}

// "kp by 3 %, b2 by -40 %, alpha by 0.2"
std::string bent_in_words(const std::vector<int>& free, const Eigen::VectorXd& bent) {
  std::ostringstream text;
  text.precision(2);
  const char* separator = "";
  for (std::size_t j = 0; j < free.size(); ++j) {
    const auto parameter = static_cast<std::size_t>(free[j]);
    if (parameter >= kParameters) continue;
    const bool is_order = parameter >= 3;
    const double by = bent[static_cast<Index>(j)];
    text << std::exchange(separator, ", ") << kParameterNames[parameter] << " by " << (is_order ? by : 100 * by)
         << (is_order ? "" : " %");
  }
  return text.str();
}

void add_initial_motion(OutputErrorSearch& search, const Recording& recording, const Fit& fit,
                        std::vector<std::string>& warnings) {
  if (!(lowest_percent(search, recording, fit) < 100 - 1e-6)) return;  // rounding
  Stacked all = stacked(search, recording, fit);
  const Eigen::VectorXd scale = all.slopes.colwise().norm().transpose().cwiseMax(1e-300).cwiseInverse();
  all.slopes *= scale.asDiagonal();
  if (!all.slopes.allFinite() || !all.residual.allFinite()) return;
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(all.slopes);
  const double longest_s = recording.dt_s * static_cast<double>(recording.duty.size()) / 4;
  InitialMotion best;
  for (double lag_s = longest_s; lag_s > 2 * recording.dt_s; lag_s /= 3) {
    const InitialMotion found = motion_with_lag(all, qr, recording.dt_s, lag_s);
    if (found.sigmas > best.sigmas) best = found;
  }
  if (!(best.sigmas > kMotionSigmas && best.share > kMotionShare)) {
    add_rough_beginning(recording, fit, warnings);
    return;
  }
  if (!(std::abs(best.velocity_m_s) > kSlowestMotionM_S)) return;
  std::ostringstream text;
  text.precision(2);
  text << "the run seems to begin in motion, at about " << best.velocity_m_s << " m/s (" << best.sigmas
       << " sigmas): the model is at rest before the first sample, which costs the fit, to first order, "
       << bent_in_words(search.free_parameters(fit.structure), scale.cwiseProduct(best.bent))
       << " (too large by it, if positive); begin the record at rest";
  warnings.push_back(text.str());
}

// The duty of each row taken to be that of the row before it, or behind it.
Recording with_shifted_duty(Recording recording, bool is_later) {
  std::vector<double>& duty = recording.duty;
  if (is_later) {
    std::copy_backward(duty.begin(), duty.end() - 1, duty.end());
  } else {
    std::copy(duty.begin() + 1, duty.end(), duty.begin());
  }
  return recording;
}

// By how many rows the output comes late, to first order, the parameters of the model being free; 0: within its noise.
double rows_late(OutputErrorSearch& search, const Recording& recording, const Fit& fit) {
  const Stacked all = stacked(search, recording, fit);
  const auto late = search.late_outputs({0, 1}, {fit.model, fit.offset_m});
  Eigen::VectorXd a_row(all.residual.size());
  for (std::size_t c = 0; c < late.size(); ++c) {
    const Eigen::VectorXd change = late[c].col(1) - late[c].col(0);
    a_row.segment(static_cast<Index>(c) * all.tick.size(), all.tick.size()) = search.counted(change) / all.sd[c];
  }
  const Eigen::VectorXd scale = all.slopes.colwise().norm().transpose().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd slopes = all.slopes * scale.asDiagonal();
  if (!slopes.allFinite() || !all.residual.allFinite()) return 0;
  const Eigen::VectorXd own = a_row - slopes * slopes.colPivHouseholderQr().solve(a_row);
  const double rows = own.dot(all.residual) / std::max(1e-300, own.squaredNorm());
  return std::abs(rows) * own.norm() > kMotionSigmas && std::abs(rows) > kNoticeableRows ? rows : 0;
}

// A duty that stands one row too early or too late moves the parameters by many sigmas. The fit is made again only
// where the residuals ask for it. Of a structure that is forced, an order too low looks the same.
void add_shifted_duty(OutputErrorSearch& search, const Recording& recording, const IdentificationOptions& options,
                      const Fit& fit, std::vector<std::string>& warnings) {
  if (options.structure && *options.structure != Structure::fractional) return;
  if (!(lowest_percent(search, recording, fit) < 100 - 1e-6)) return;  // rounding
  const double rows = rows_late(search, recording, fit);
  if (rows == 0) return;
  const auto shifted = fit_again(search, with_shifted_duty(recording, rows > 0), options, fit.structure);
  if (!shifted || !(shifted->aic < fit.aic - kClearlyLowerAic)) return;
  std::ostringstream text;
  text.precision(3);
  text << "with the duty one row " << (rows > 0 ? "later" : "earlier")
       << " the model explains clearly more (AIC lower by " << fit.aic - shifted->aic
       << ", kp, b1, b2, alpha, beta = " << shifted->model.kp << ", " << shifted->model.b1 << ", " << shifted->model.b2
       << ", " << shifted->model.alpha << ", " << shifted->model.beta
       << "): the duty of a row must be what the motor has from that row on to the next; "
       << (rows > 0 ? "move the column down by a row, or search for a dead time" +
                          in_brackets(options.names.dead_time) + ", if there is one"
                    : "move the column up by a row");
  warnings.push_back(text.str());
}

}  // namespace

std::vector<std::string> lag_doubts(const Recording& recording, const IdentificationOptions& options, const Fit& fit) {
  if (!fit.sensor || fit.starts == 0) return {};
  const SensorFit& sensor = *fit.sensor;
  const bool finds_dead_time = options.longest_dead_time_s > 0;
  if (sensor.delay_is_at_limit && !finds_dead_time) {
    return {
        base::join_text("the sensor's readings came out ", 1e3 * sensor.delay_s,
                        " ms late, the most that is searched for without a dead time: the other parameters make up for "
                        "what it lacks; search for a dead time",
                        in_brackets(options.names.dead_time))};
  }
  // How old samples in step with the ticks are is not known: up to a period.
  const double late_s = sensor.delay_s - options.sensor_lag_s.value_or(0), half_period_s = recording.dt_s / 2;
  const double at_least_s = late_s - (sensor.has_own_clock ? half_period_s : 2 * half_period_s);
  const double at_most_s = late_s - (sensor.has_own_clock ? half_period_s : 0);
  if (options.sensor_lag_s && at_most_s < -kNoticeableLagS) {
    return {base::join_text(
        "the sensor's readings come ", 1e3 * (at_most_s + *options.sensor_lag_s),
        " ms late at most, less than the sensor's own lag that was given, ", 1e3 * *options.sensor_lag_s,
        " ms, which hides any dead time: give the lag that it has, in seconds", in_brackets(options.names.sensor_lag))};
  }
  if (!(at_least_s > kNoticeableLagS)) return {};
  std::ostringstream text;
  text.precision(3);
  if (!options.sensor_lag_s) {
    text << "a dead time of up to " << 1e3 * at_most_s << " ms cannot be told from the age of the sensor's readings: "
         << (finds_dead_time ? 1e3 * fit.model.dead_time_s : 1e3 * at_most_s) << " ms were attributed to the "
         << (finds_dead_time
                 ? "plant; give the sensor's own lag" + in_brackets(options.names.sensor_lag) + ", if it is known"
                 : "readings, none to the plant; if the sensor is not so late, search for the dead time" +
                       in_brackets(options.names.dead_time));
    return {text.str()};
  }
  if (finds_dead_time) return {};
  text << "the readings come up to " << 1e3 * at_most_s << " ms later than the sensor's own lag explains: that is a "
       << "dead time, and the model has none; search for it" << in_brackets(options.names.dead_time);
  return {text.str()};
}

bool asks_for_dead_time(const Recording& recording, const IdentificationOptions& options, const Fit& fit,
                        const std::optional<ScoreEvidence>& amplitude, const std::optional<ScoreEvidence>& input) {
  if (!options.tries_dead_time || options.longest_dead_time_s > 0 || fit.starts == 0) return false;
  if (fit.end == SearchEnd::cancelled) return false;
  if (!fit.sensor) {
    const bool is_forced = options.structure && *options.structure != Structure::fractional;
    const bool has_fitted_clock = options.fits_position_clock && !recording.position_time_s.empty();
    return may_lack_dead_time(input) && !changes_with_amplitude(amplitude) && !is_forced && !has_fitted_clock;
  }
  if (fit.sensor->delay_is_at_limit) return true;
  const double age_s = fit.sensor->has_own_clock ? recording.dt_s / 2 : recording.dt_s;  // at most
  const double late_s = fit.sensor->delay_s - age_s - options.sensor_lag_s.value_or(0);
  return late_s > (options.sensor_lag_s ? kNoticeableLagS : kLagsOfTheSensor * kLagSdS);
}

bool is_explained_better(const DeadTimeTrial& with_dead_time, const DeadTimeTrial& without, bool by_acceleration) {
  if (!(with_dead_time.fit.model.dead_time_s > 0)) return false;
  if (!by_acceleration) {
    return with_dead_time.fit.aic < without.fit.aic - kClearlyLowerAic &&
           is_settled_by_dead_time(with_dead_time.input, without.input);
  }
  // The delay of readings that were late has become the plant's: with as many parameters the residuals are as small.
  // How many readings are left out differs, so that no AIC tells.
  return with_dead_time.fit.residual_sd < kAsSmall * without.fit.residual_sd;
}

std::string dead_time_in_words(const Fit& fit, double dt_s) {
  std::ostringstream text;
  text.precision(3);
  text << "a dead time of " << 1e3 * fit.model.dead_time_s << " ms was found, which nobody named; a column of the duty "
       << "that is " << fit.model.dead_time_s / dt_s << " rows too early looks the same";
  return text.str();
}

std::vector<std::string> second_opinions(OutputErrorSearch& search, const Recording& recording,
                                         const IdentificationOptions& options, const Fit& fit) {
  std::vector<std::string> warnings;
  if (fit.end != SearchEnd::converged || search.limit().end()) return warnings;
  add_turned_sign(search, recording, options, fit, warnings);
  if (!warnings.empty()) return warnings;
  add_missing_offset(search, recording, options, fit, warnings);
  if (fit.sensor || !recording.position_time_s.empty()) return warnings;  // they have a clock of their own
  add_initial_motion(search, recording, fit, warnings);
  add_shifted_duty(search, recording, options, fit, warnings);
  return warnings;
}

}  // namespace control
