// Each doubt is one sentence with its numbers and a way out.
#include "control/identifiability.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace control {
namespace {

constexpr std::array<double, kParameters> kLargestSigma{0.1, 0.5, 0.5, 0.1, 0.1};  // relative but for the orders
constexpr double kLargestCorrelation = 0.99;
constexpr double kNearBound = 2e-3;
constexpr double kFitOfRounding = 100 - 1e-6;  // percent; what is left is no noise
constexpr double kPlanDurationS = 60, kPlanBitS = 0.2;
constexpr double kPlanMostSamples = 20000;

bool is_order(std::size_t parameter) { return parameter >= 3; }

std::array<double, kParameters> values(const FractionalModel& m) { return {m.kp, m.b1, m.b2, m.alpha, m.beta}; }

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

// What a longer run with more changes would reach, with the residuals of this one.
std::string better_experiment(const Recording& recording, const Fit& fit, bool fits_offset,
                              const std::vector<std::size_t>& parameters) {
  const auto sd = [](const std::vector<double>& residual) {
    double sum = 0;
    for (const double r : residual) sum += r * r;
    return residual.empty() ? 0 : std::sqrt(sum / static_cast<double>(residual.size()));
  };
  PlannedExperiment plan;
  plan.dt_s = std::max(recording.dt_s, kPlanDurationS / kPlanMostSamples);
  if (plan.dt_s > kPlanBitS) return "a duty that changes often, sampled faster than every 0.2 s, would tell more";
  plan.duty = prbs_duty(1, kPlanBitS, kPlanDurationS, plan.dt_s);
  plan.position_sd_m = sd(fit.position_residual_m);
  plan.velocity_sd_m_s = sd(fit.velocity_residual_m_s);
  plan.fits_offset = fits_offset;
  if (plan.position_sd_m == 0 && plan.velocity_sd_m_s == 0) return "the residuals are zero";
  const ExpectedUncertainty expected = expected_uncertainty(fit.model, plan);
  std::vector<std::string> words;
  for (const std::size_t i : parameters) {
    words.push_back(sigma_words(i, expected.one_sigma[i], values(fit.model)[i]));
  }
  return "a ±1 PRBS of 60 s with 0.2 s bits and the same noise would give " + enumerated(words);
}

void add_undetermined(const Recording& recording, const Fit& fit, bool fits_offset,
                      std::vector<std::string>& warnings) {
  const auto value = values(fit.model);
  std::vector<std::size_t> doubtful;
  std::vector<std::string> names, sigmas;
  for (std::size_t i = 0; i < kParameters; ++i) {
    if (!is_free(fit.structure, i)) continue;
    const double unit = is_order(i) ? 1 : value[i];
    if (fit.one_sigma[i] && *fit.one_sigma[i] <= kLargestSigma[i] * unit) continue;
    doubtful.push_back(i);
    names.emplace_back(kParameterNames[i]);
    sigmas.push_back(sigma_words(i, fit.one_sigma[i], value[i]));
  }
  if (doubtful.empty()) return;
  warnings.push_back("this run cannot determine " + enumerated(names) + ": one sigma is " + enumerated(sigmas) +
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

void add_at_bounds(const Fit& fit, std::vector<std::string>& warnings) {
  if (fit.structure != Structure::fractional) return;
  const auto add = [&](const char* name, double order, double lower, double upper, const char* meaning) {
    if (order > lower + kNearBound && order < upper - kNearBound) return;
    std::ostringstream text;
    text.precision(6);
    text << name << " = " << order << " lies at its bound " << (order < (lower + upper) / 2 ? lower : upper)
         << " (allowed: " << lower << " to " << upper << "): " << meaning
         << "; its sigma means little there, so compare with the integer structures by AIC";
    warnings.push_back(text.str());
  };
  add("alpha", fit.model.alpha, 1, 2, "the data do not need this fractional order, or do not show it");
  add("beta", fit.model.beta, 0, 1, "the data do not need this fractional order, or do not show it");
}

void add_of_search(const Fit& fit, const Recording& recording, std::vector<std::string>& warnings) {
  std::ostringstream text;
  text.precision(3);
  if (std::ranges::all_of(recording.duty, [&](double duty) { return duty == recording.duty.front(); })) {
    text << "the duty is " << recording.duty.front()
         << " throughout: a single step shows fast terms only in its first samples; change the duty during the run";
    warnings.push_back(text.str());
  }
  if (!fit.residuals_are_white && fit.fit_percent < kFitOfRounding) {
    text.str("");
    text << "the residuals are not white (Ljung-Box p = " << fit.whiteness_p_value
         << ", below 0.01): the sigmas are too small; look for disturbances, a dead time, or noise that is filtered";
    warnings.push_back(text.str());
  }
  if (fit.starts > 1 && fit.starts_that_agree < 2) {
    text.str("");
    text << "only " << fit.starts_that_agree << " of " << fit.starts
         << " starts reached the best cost: it may be a local minimum; raise further_starts or the iteration limit";
    warnings.push_back(text.str());
  }
  if (fit.end != SearchEnd::converged) {
    const char* how = fit.end == SearchEnd::cancelled         ? "was cancelled"
                      : fit.end == SearchEnd::iteration_limit ? "reached its iteration limit"
                                                              : "reached its time limit";
    text.str("");
    text << "the search " << how << " after " << fit.iterations
         << " iterations: the parameters are the best so far, not the optimum; raise the limit";
    warnings.push_back(text.str());
  }
}

}  // namespace

std::string structure_name(Structure structure) {
  return structure == Structure::fractional     ? "fractional"
         : structure == Structure::second_order ? "second order"
                                                : "first order";
}

std::vector<std::string> identifiability_warnings(const Recording& recording, const Fit& fit, bool fits_offset) {
  std::vector<std::string> warnings;
  add_undetermined(recording, fit, fits_offset, warnings);
  add_correlated(fit, warnings);
  add_at_bounds(fit, warnings);
  add_of_search(fit, recording, warnings);
  return warnings;
}

}  // namespace control
