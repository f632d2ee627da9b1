// Reads the doubts off a fit, and words them.
#include "control/identification/doubts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <sstream>
#include <utility>

#include "control/evidence/score_doubts.hpp"
#include "control/identification/identifiability.hpp"
#include "control/sensor/sensor_prior.hpp"

namespace control {
namespace {

constexpr double kWholeRun = 0.999;
constexpr double kSmallestDeadTimeSdS = 0.0005;
constexpr double kFarSds = 3;  // of a prior

void add_search(const Fit& fit, std::vector<Doubt>& doubts) {
  if (fit.end == SearchEnd::converged) return;
  doubts.push_back({DoubtCode::search_not_converged, fit.iterations, {}, std::nullopt});
}

void add_residuals(const Fit& fit, const std::optional<ScoreEvidence>& amplitude,
                   const std::optional<ScoreEvidence>& input, std::vector<Doubt>& doubts) {
  if (changes_with_amplitude(amplitude)) {
    doubts.push_back({DoubtCode::no_linear_model_over_amplitude, amplitude->share, {}, amplitude->widening});
  } else if (follows_input(input)) {
    doubts.push_back({DoubtCode::correlated_with_input, input->share, {}, input->widening});
  }
  if (!fit.residuals_are_white) {
    doubts.push_back({DoubtCode::residuals_not_white, fit.colour_factor, {}, fit.colour_factor});
  }
  if (fit.drift_factor > 1) doubts.push_back({DoubtCode::residuals_drift, fit.drift_factor, {}, fit.drift_factor});
}

// With all digits before the point: 100, not 1e+02.
std::string rounded(double value, int digits) {
  const double size = std::abs(value) * (1 + 0.5 * std::pow(10, -digits));
  const bool is_plain = size >= 1 && size < 1e6;
  std::ostringstream text;
  text.precision(is_plain ? std::max(digits, static_cast<int>(std::log10(size)) + 1) : digits);
  text << value;
  return text.str();
}

}  // namespace

bool is_grave(const Doubt& doubt) {
  return !doubt.widening || *doubt.widening > kGraveWidening || doubt.code == DoubtCode::dead_zone;
}

std::string in_words(const Doubt& doubt) {
  const double value = doubt.value.value_or(0);
  switch (doubt.code) {
    case DoubtCode::search_not_converged:
      return "the search did not converge: the parameters are the best after " + rounded(value, 6) + " iterations";
    case DoubtCode::no_linear_model_over_amplitude:
      return "no linear model holds over the amplitudes of the run: ones that follow duty and speed explain " +
             rounded(100 * value, 2) + " % of what the model leaves";
    case DoubtCode::correlated_with_input:
      return "the residuals follow the duty: another linear model would explain " + rounded(100 * value, 2) +
             " % of what this one leaves";
    case DoubtCode::sensor_unlike_data_sheet:
      return std::string{"the sensor's "} + (doubt.parameter == "period_s" ? "clock" : "low pass") + " is " +
             rounded(value, 2) + " sds off its data sheet";
    case DoubtCode::runs_disagree:
      return "the runs do not agree on one model: parameters of their own explain " + rounded(100 * value, 2) +
             " % of what the common ones leave";
    case DoubtCode::residuals_not_white:
      return "the residuals are not white: the sigmas are too small by a factor of " + rounded(value, 2);
    case DoubtCode::residuals_drift:
      return "the residuals drift: the sigmas are too small by a factor of " + rounded(value, 2);
    case DoubtCode::parameter_not_determined:
      return doubt.parameter + " is not determined: one sigma is " +
             (doubt.value ? rounded(value, 2) : std::string{"without bound"});
    case DoubtCode::parameter_at_bound:
      return doubt.parameter + " = " + rounded(value, 6) + " lies at its bound, where its sigma means little";
    case DoubtCode::dead_time_not_determined:
      return doubt.value ? "the age of the readings hides a part of the dead time: one sigma of it is " +
                               rounded(1e3 * value, 2) + " ms"
                         : "the dead time is not determined: it lies at the limit of the search";
    case DoubtCode::dead_zone:
      return "the motor stands still up to a duty of " + rounded(value, 2) +
             ", which the model does not hold: set the robot's dead_zone_duty to it";
    case DoubtCode::part_of_run_used: return "the fit used " + rounded(100 * value, 4) + " % of the run";
  }
  return "a doubt that this version does not know";
}

std::optional<double> widening(std::span<const Doubt> doubts) {
  double square = 1;
  for (const Doubt& doubt : doubts) {
    if (!doubt.widening) return std::nullopt;
    square += *doubt.widening * *doubt.widening - 1;
  }
  return std::sqrt(square);
}

double dead_time_sd_s(std::span<const Doubt> doubts) {
  const auto found = std::ranges::find(doubts, DoubtCode::dead_time_not_determined, &Doubt::code);
  return found == doubts.end() ? 0 : found->value.value_or(0);
}

std::vector<Doubt> sensor_doubts(const Fit& fit) {
  if (!fit.sensor) return {};
  std::vector<Doubt> doubts;
  const double low_pass_sds = std::log(fit.sensor->time_constant_s / kDataSheetTimeConstantS) / kLowPassSd;
  const std::array<std::pair<const char*, double>, 2> off{
      {{"time_constant_s", low_pass_sds}, {"period_s", fit.sensor->clock_off / kClockSd}}};
  for (const auto& [name, sds] : off) {
    if (!(std::abs(sds) > kFarSds)) continue;
    const double widening = std::sqrt(1 + (sds * sds - 1) / std::max(1, fit.free_parameters));
    doubts.push_back({DoubtCode::sensor_unlike_data_sheet, std::abs(sds), name, widening});
  }
  return doubts;
}

std::vector<Doubt> doubts_about(const Fit& fit, const std::optional<ScoreEvidence>& amplitude,
                                const std::optional<ScoreEvidence>& input, double share_used) {
  std::vector<Doubt> doubts;
  add_search(fit, doubts);
  add_residuals(fit, amplitude, input, doubts);
  std::ranges::move(sensor_doubts(fit), std::back_inserter(doubts));
  for (const std::size_t i : undetermined_parameters(fit)) {
    std::optional<double> sigma = fit.one_sigma[i];
    if (sigma && !is_order(i)) *sigma /= parameters_of(fit.model)[i];
    doubts.push_back({DoubtCode::parameter_not_determined, sigma, kParameterNames[i]});
  }
  for (const std::size_t i : parameters_at_bound(fit)) {
    doubts.push_back({DoubtCode::parameter_at_bound, parameters_of(fit.model)[i], kParameterNames[i]});
  }
  if (share_used < kWholeRun) doubts.push_back({DoubtCode::part_of_run_used, share_used});
  return doubts;
}

std::optional<Doubt> dead_time_doubt(const Fit& fit, const IdentificationOptions& options, double dt_s) {
  if (!fit.sensor || fit.starts == 0) return std::nullopt;
  if (fit.sensor->delay_is_at_limit) return Doubt{DoubtCode::dead_time_not_determined, std::nullopt, {}, std::nullopt};
  const double late_s = std::max(0.0, fit.sensor->delay_s - dt_s / 2);
  const bool is_no_lag = fit.model.dead_time_s == 0 && late_s > kFarSds * kLagSdS;
  const double of_lag_s = options.sensor_lag_s ? 0 : is_no_lag ? late_s : std::min(kLagSdS, late_s);
  const double of_age_s = fit.sensor->has_own_clock ? 0 : dt_s / std::sqrt(12.0);
  const double sd_s = std::hypot(of_lag_s, of_age_s);
  if (sd_s < kSmallestDeadTimeSdS) return std::nullopt;
  return Doubt{DoubtCode::dead_time_not_determined, sd_s};
}

}  // namespace control
