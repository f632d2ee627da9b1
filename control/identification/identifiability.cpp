// Each doubt is one sentence with its numbers and a way out.
#include "control/identification/identifiability.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "base/invalid_argument.hpp"
#include "control/identification/planned_experiment.hpp"

namespace control {
namespace {

constexpr std::array<double, kParameters> kLargestSigma{0.1, 0.5, 0.5, 0.1, 0.1};  // relative but for the orders
constexpr double kLargestCorrelation = 0.99;
constexpr double kNearBound = 2e-3;
constexpr double kNothingPercent = 1;
constexpr double kDeadTimeAtLimit = 0.99;  // of the longest
constexpr double kWorthPlanning = 2;       // times better
constexpr double kPlanDurationS = 60, kPlanBitS = 0.2;
constexpr double kPlanMostSamples = 20000;

double lower_bound_of(std::size_t order) { return order == 3 ? 1 : 0; }  // (4) of identify.hpp

bool is_free(Structure structure, std::size_t parameter) {
  if (structure == Structure::fractional) return true;
  return !is_order(parameter) && !(structure == Structure::first_order && parameter == 1);
}

std::string enumerated(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == words.size() ? " and " : ", ") + words[i];
  }
  return text;
}

// "1.3 for alpha", "4.7 times b1".
std::string sigma_words(std::size_t parameter, std::optional<double> sigma, double value) {
  std::ostringstream text;
  text.precision(2);
  if (!sigma) {
    text << "unbounded for " << kParameterNames[parameter];
  } else if (is_order(parameter)) {
    text << *sigma << " for " << kParameterNames[parameter];
  } else {
    text << *sigma / value << " times " << kParameterNames[parameter];
  }
  return text.str();
}

bool can_be_planned_with(const FractionalModel& m, const PlannedExperiment& plan) {
  const auto is_sd = [](double value) { return value >= 0 && std::isfinite(value); };
  return base::is_positive(m.kp) && base::is_positive(m.b2) && base::is_positive(m.b3) && m.b1 >= 0 &&
         std::isfinite(m.b1) && m.beta > 0 && m.beta <= 1 && m.alpha > m.beta && m.alpha <= 2 &&
         is_sd(plan.position_sd_m) && is_sd(plan.velocity_sd_m_s) && is_sd(plan.acceleration_sd_m_s2) &&
         plan.position_sd_m + plan.velocity_sd_m_s + plan.acceleration_sd_m_s2 > 0;
}

double standard_deviation(const std::vector<double>& residual) {
  double sum = 0;
  for (const double r : residual) sum += r * r;
  return residual.empty() ? 0 : std::sqrt(sum / static_cast<double>(residual.size()));
}

// What a longer run with more changes would reach, with the residuals of this one.
std::string better_experiment(const Recording& recording, const Fit& fit, bool fits_offset,
                              const std::vector<std::size_t>& parameters) {
  if (!describes_run(fit)) {
    return "the model does not describe the run, so that no better experiment can be computed from it";
  }
  PlannedExperiment plan;
  plan.dt_s = std::max(recording.dt_s, kPlanDurationS / kPlanMostSamples);
  if (plan.dt_s > kPlanBitS) return "a duty that changes often, sampled faster than every 0.2 s, would tell more";
  plan.duty = prbs_duty(1, kPlanBitS, kPlanDurationS, plan.dt_s);
  plan.position_sd_m = standard_deviation(fit.position_residual_m);
  if (!recording.position_time_s.empty()) {  // fewer values than samples tell less
    plan.position_sd_m *=
        std::sqrt(static_cast<double>(recording.duty.size()) / static_cast<double>(recording.position_time_s.size()));
  }
  plan.velocity_sd_m_s = standard_deviation(fit.velocity_residual_m_s);
  plan.acceleration_sd_m_s2 = fit.sensor ? fit.residual_sd : 0;
  plan.fits_offset = fits_offset;
  if (!can_be_planned_with(fit.model, plan)) return "change the duty during a longer run";
  const ExpectedUncertainty expected = expected_uncertainty(fit.model, plan);
  std::vector<std::string> words;
  bool is_better = false;
  for (const std::size_t i : parameters) {
    const auto& sigma = expected.one_sigma[i];
    if (!sigma || !std::isfinite(*sigma)) continue;
    is_better = is_better || !fit.one_sigma[i] || !(*fit.one_sigma[i] < kWorthPlanning * *sigma);
    words.push_back(sigma_words(i, sigma, parameters_of(fit.model)[i]));
  }
  if (!is_better) {
    return "a ±1 PRBS of 60 s with 0.2 s bits would not do much better: make the run longer or the motion larger, or "
           "measure with less noise";
  }
  return "a ±1 PRBS of 60 s with 0.2 s bits and the same noise would give " + enumerated(words);
}

void add_undetermined(const Recording& recording, const Fit& fit, bool fits_offset, std::size_t runs,
                      std::vector<std::string>& warnings) {
  const std::vector<std::size_t> doubtful = undetermined_parameters(fit);
  if (doubtful.empty()) return;
  std::vector<std::string> names, sigmas;
  for (const std::size_t i : doubtful) {
    names.emplace_back(kParameterNames[i]);
    sigmas.push_back(sigma_words(i, fit.one_sigma[i], parameters_of(fit.model)[i]));
  }
  const std::string subject = runs == 1 ? "this run cannot" : "these runs together cannot";
  warnings.push_back(subject + " determine " + enumerated(names) + ": one sigma is " + enumerated(sigmas) +
                     " (trust at most 0.1 times kp, 0.5 times b1 or b2, 0.1 for the orders); compare responses, not "
                     "parameters; " +
                     better_experiment(recording, fit, fits_offset, doubtful));
}

void add_correlated(const Fit& fit, std::vector<std::string>& warnings) {
  for (std::size_t i = 0; i < kParameters; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double correlation = fit.correlation[i][j];
      if (!(std::abs(correlation) > kLargestCorrelation)) continue;
      std::ostringstream text;
      text.precision(4);
      text << kParameterNames[j] << " and " << kParameterNames[i] << " have a correlation of " << correlation
           << ": the run tells little more than a combination of the two; do not read them one by one, and let the "
              "duty change faster to part them";
      warnings.push_back(text.str());
    }
  }
}

bool dead_time_is_at_its_limit(const Fit& fit, const IdentificationOptions& options) {
  return options.longest_dead_time_s > 0 && fit.model.dead_time_s > kDeadTimeAtLimit * options.longest_dead_time_s;
}

void add_at_bounds(const Fit& fit, const IdentificationOptions& options, std::vector<std::string>& warnings) {
  const char* meaning = dead_time_is_at_its_limit(fit, options)
                            ? "probably because the dead time is at its limit; raise that first"
                        : !describes_run(fit) ? "the model does not describe the run, so this order means nothing"
                                              : "the data do not need this fractional order, or do not show it";
  for (const std::size_t i : parameters_at_bound(fit)) {
    const double order = parameters_of(fit.model)[i], lower = lower_bound_of(i), upper = lower + 1;
    std::ostringstream text;
    text.precision(6);
    text << kParameterNames[i] << " = " << order << " lies at its bound "
         << (order < (lower + upper) / 2 ? lower : upper) << " (allowed: " << lower << " to " << upper
         << "): " << meaning << "; its sigma means little there, so compare with the integer structures by AIC";
    warnings.push_back(text.str());
  }
}

bool has_constant_duty(const Recording& recording) {
  return std::ranges::all_of(recording.duty, [&](double duty) { return duty == recording.duty.front(); });
}

void add_constant_duty(const Recording& recording, std::vector<std::string>& warnings) {
  if (!has_constant_duty(recording)) return;
  warnings.push_back(base::join_text("the duty is ", recording.duty.front(),
                                     " throughout: a single step shows fast terms ",
                                     "only in its first samples; change the duty during the run"));
}

}  // namespace

bool is_order(std::size_t parameter) { return parameter >= 3; }

std::array<double, kParameters> parameters_of(const FractionalModel& m) { return {m.kp, m.b1, m.b2, m.alpha, m.beta}; }

std::vector<std::size_t> undetermined_parameters(const Fit& fit) {
  std::vector<std::size_t> undetermined;
  if (fit.starts == 0) return undetermined;
  for (std::size_t i = 0; i < kParameters; ++i) {
    const double unit = is_order(i) ? 1 : parameters_of(fit.model)[i];
    const bool is_determined = fit.one_sigma[i] && *fit.one_sigma[i] <= kLargestSigma[i] * unit;
    if (is_free(fit.structure, i) && !is_determined) undetermined.push_back(i);
  }
  return undetermined;
}

std::vector<std::size_t> parameters_at_bound(const Fit& fit) {
  std::vector<std::size_t> found;
  if (fit.structure != Structure::fractional || fit.starts == 0) return found;
  const auto values = parameters_of(fit.model);
  for (std::size_t i = 0; i < kParameters; ++i) {
    if (lies_at_bound(i, values[i])) found.push_back(i);
  }
  return found;
}

bool lies_at_bound(std::size_t parameter, double value) {
  if (!is_order(parameter)) return false;
  const double beyond_lower = value - lower_bound_of(parameter);
  return beyond_lower <= kNearBound || beyond_lower >= 1 - kNearBound;
}

bool describes_run(const Fit& fit) {
  return fit.fit_percent >= kPoorFitPercent || (fit.sensor && fit.residuals_are_white);
}

bool explains_nothing(const Recording& recording, const Fit& fit) {
  return fit.fit_percent < kNothingPercent && (has_constant_duty(recording) || !describes_run(fit));
}

std::string structure_name(Structure structure) {
  return structure == Structure::fractional     ? "fractional"
         : structure == Structure::second_order ? "second order"
                                                : "first order";
}

std::string end_words(SearchEnd end) {
  switch (end) {
    case SearchEnd::converged: return "converged";
    case SearchEnd::iteration_limit: return "reached its iteration limit";
    case SearchEnd::time_limit: return "reached its time limit";
    case SearchEnd::cancelled: return "was cancelled";
    case SearchEnd::not_finite: return "met numbers that are not finite";
  }
  return "ended";
}

std::vector<std::string> search_doubts(const Fit& fit, const IdentificationOptions& options) {
  std::vector<std::string> warnings;
  if (fit.starts == 0) {
    warnings.push_back(
        base::join_text("the search ", end_words(fit.end),
                        " before its first iteration: the parameters are the paper's start, with the best "
                        "gain, and say nothing"));
  } else if (fit.end == SearchEnd::not_finite) {
    warnings.push_back(
        base::join_text("the search ", end_words(fit.end), " after ", fit.iterations,
                        " iterations: the parameters are the best so far; check the units of the recording"));
  } else if (fit.end != SearchEnd::converged) {
    warnings.push_back(base::join_text("the search ", end_words(fit.end), " after ", fit.iterations,
                                       " iterations of start ", fit.starts, " of ", 1 + options.further_starts,
                                       ": the parameters are the best so far, not the optimum; record a longer run, or "
                                       "one in which the duty changes faster"));
  }
  if (dead_time_is_at_its_limit(fit, options)) {
    warnings.push_back(base::join_text("the dead time, ", fit.model.dead_time_s,
                                       " s, lies at the longest that was allowed, ", options.longest_dead_time_s,
                                       " s: the other parameters make up for what it lacks; allow a longer one"));
  }
  if (fit.starts > 1 && fit.starts_that_agree < 2) {
    warnings.push_back(
        base::join_text("only ", fit.starts_that_agree, " of ", fit.starts,
                        " starts reached the best cost: it may be a local minimum; identify another run of the same "
                        "fluid, and compare"));
  }
  return warnings;
}

std::vector<std::string> identifiability_warnings(const Recording& recording, const Fit& fit,
                                                  const IdentificationOptions& options, std::size_t runs) {
  std::vector<std::string> warnings;
  if (runs == 1) add_constant_duty(recording, warnings);
  if (fit.starts == 0) return warnings;
  add_undetermined(recording, fit, options.fits_offset && !recording.position_m.empty(), runs, warnings);
  add_correlated(fit, warnings);
  add_at_bounds(fit, options, warnings);
  return warnings;
}

}  // namespace control
