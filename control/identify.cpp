// Checks the recording, fits the structures asked for, compares them and words the doubts.
#include "control/identify.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "control/fit_statistics.hpp"
#include "control/identifiability.hpp"
#include "control/invalid_argument.hpp"
#include "control/output_error_search.hpp"

namespace control {
namespace {

using Eigen::Index;

constexpr std::size_t kFewestSamples = 20, kMostSamples = 200000;
constexpr double kEqualSteps = 0.01;
constexpr double kSmallestResidualShare = 1e-9;  // of the signal; what is less is rounding and no reason to choose
constexpr double kWhite = 0.01;

template <typename... Parts>
[[noreturn]] void refuse(const Parts&... parts) {
  throw_invalid("identification: ", parts...);
}

void check_column(const char* name, std::span<const double> values, std::size_t expected) {
  if (values.size() != expected) {
    refuse(name, " has ", values.size(), " values, duty has ", expected, ": give one per sample, or none");
  }
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (!std::isfinite(values[k])) refuse(name, '[', k, "] is ", values[k], ": remove or repair it");
  }
}

void check_output(const char* name, std::span<const double> values, std::size_t expected) {
  if (values.empty()) return;
  check_column(name, values, expected);
  if (std::ranges::all_of(values, [&](double value) { return value == values.front(); })) {
    refuse(name, " is ", values.front(), " throughout: record a run in which the robot moves");
  }
}

void check(const Recording& recording) {
  const std::size_t samples = recording.duty.size();
  if (!(recording.dt_s > 0 && std::isfinite(recording.dt_s))) refuse("dt_s must be positive, is ", recording.dt_s);
  if (samples < kFewestSamples) refuse("duty has ", samples, " samples: record at least ", kFewestSamples);
  if (samples > kMostSamples) {
    refuse("duty has ", samples, " samples, more than ", kMostSamples, ": cut the run or sample it more slowly");
  }
  if (recording.position_m.empty() && recording.velocity_m_s.empty()) {
    refuse("position_m and velocity_m_s are both empty: give one of them");
  }
  check_column("duty", recording.duty, samples);
  check_output("position_m", recording.position_m, samples);
  check_output("velocity_m_s", recording.velocity_m_s, samples);
  if (std::all_of(recording.duty.begin(), recording.duty.end() - 1, [](double duty) { return duty == 0; })) {
    refuse("duty is 0 throughout, which excites nothing: record a run with a step or a changing duty");
  }
}

void check(const IdentificationOptions& options, const Recording& recording) {
  const double longest_s = options.longest_dead_time_s;
  const double half_s = recording.dt_s * static_cast<double>(recording.duty.size() - 1) / 2;
  if (!(longest_s >= 0 && longest_s <= half_s)) {
    refuse("longest_dead_time_s must be from 0 to half the record, ", half_s, ", is ", longest_s);
  }
  if (!(options.time_limit_s > 0)) refuse("time_limit_s must be positive, is ", options.time_limit_s);
  if (options.iteration_limit < 1) refuse("iteration_limit must be at least 1, is ", options.iteration_limit);
  if (options.further_starts < 0 || options.further_starts > 1000) {
    refuse("further_starts must be from 0 to 1000, is ", options.further_starts);
  }
}

double akaike(Cost cost, const std::vector<Eigen::VectorXd>& residuals,
              const std::vector<const std::vector<double>*>& measured, int free_parameters) {
  double sum = 2.0 * free_parameters;
  for (std::size_t c = 0; c < residuals.size(); ++c) {
    const double n = static_cast<double>(residuals[c].size());
    const Eigen::Map<const Eigen::VectorXd> y(measured[c]->data(), residuals[c].size());
    const double floor = kSmallestResidualShare * std::sqrt((y.array() - y.mean()).square().mean());
    const double sd = std::max(floor, residuals[c].norm() / std::sqrt(n));
    const double mean_size = std::max(floor, residuals[c].lpNorm<1>() / n);
    sum += 2 * n * std::log(cost == Cost::least_squares ? sd : mean_size);
  }
  return sum;
}

void add_uncertainty(OutputErrorSearch& search, const SearchPoint& point, const std::vector<Eigen::VectorXd>& residuals,
                     Fit& fit) {
  const std::vector<int> free = search.free_parameters(fit.structure);
  std::vector<Eigen::MatrixXd> jacobians = search.jacobians(fit.structure, point);
  const double channels = static_cast<double>(jacobians.size());
  Eigen::MatrixXd stacked(jacobians.front().rows() * static_cast<Index>(jacobians.size()),
                          static_cast<Index>(free.size()));
  for (std::size_t c = 0; c < jacobians.size(); ++c) {
    const Index samples = jacobians[c].rows();
    const double freedom = static_cast<double>(samples) - static_cast<double>(free.size()) / channels;
    const double sd = std::max(1e-200, residuals[c].norm() / std::sqrt(freedom));
    stacked.middleRows(static_cast<Index>(c) * samples, samples) = jacobians[c] / sd;
  }
  const Uncertainty found = uncertainty(stacked);
  const std::array<double, kParameters> unit{fit.model.kp, fit.model.b1, fit.model.b2, 1, 1};
  for (std::size_t i = 0; i < free.size(); ++i) {
    const auto row = static_cast<std::size_t>(free[i]);
    if (free[i] == kOffset) fit.offset_sigma_m = found.one_sigma[i];
    if (free[i] == kDeadTime) fit.dead_time_sigma_s = found.one_sigma[i];
    if (row >= kParameters) continue;
    if (found.one_sigma[i]) fit.one_sigma[row] = *found.one_sigma[i] * unit[row];
    for (std::size_t j = 0; j < free.size(); ++j) {
      const auto column = static_cast<std::size_t>(free[j]);
      if (column >= kParameters) continue;
      fit.correlation[row][column] = found.correlation(static_cast<Index>(i), static_cast<Index>(j));
    }
  }
}

void add_quality(const Eigen::VectorXd& residual, const std::vector<double>& measured, Fit& fit) {
  const Eigen::Map<const Eigen::VectorXd> y(measured.data(), residual.size());
  fit.fit_percent = 100 * (1 - residual.norm() / (y.array() - y.mean()).matrix().norm());
  fit.residual_sd = residual.norm() / std::sqrt(static_cast<double>(residual.size()));
  fit.whiteness_p_value = whiteness_p_value(residual);
  fit.residuals_are_white = fit.whiteness_p_value >= kWhite;
}

Fit fit_structure(OutputErrorSearch& search, const Recording& recording, const IdentificationOptions& options,
                  Structure structure) {
  const SearchResult found = search.run(structure);
  Fit fit;
  fit.structure = structure;
  fit.model = found.point.model;
  fit.offset_m = found.point.offset_m;
  fit.dead_time_s = found.point.dead_time_s;
  fit.end = found.end;
  fit.iterations = found.iterations;
  fit.starts = found.starts;
  fit.starts_that_agree = found.starts_that_agree;
  fit.free_parameters = static_cast<int>(search.free_parameters(structure).size());

  const std::vector<Eigen::VectorXd> residuals = search.residuals(found.point);
  std::vector<const std::vector<double>*> measured;
  const std::vector<Channel> channels = search.channels();
  for (std::size_t c = 0; c < residuals.size(); ++c) {
    const bool is_position = channels[c] == Channel::position;
    measured.push_back(is_position ? &recording.position_m : &recording.velocity_m_s);
    auto& kept = is_position ? fit.position_residual_m : fit.velocity_residual_m_s;
    kept.assign(residuals[c].begin(), residuals[c].end());
    fit.sse += residuals[c].squaredNorm();
    fit.absolute_error += residuals[c].lpNorm<1>() * recording.dt_s;
  }
  add_quality(residuals.front(), *measured.front(), fit);
  fit.aic = akaike(options.cost, residuals, measured, fit.free_parameters);
  add_uncertainty(search, found.point, residuals, fit);
  return fit;
}

}  // namespace

Recording make_recording(std::span<const double> time_s, std::span<const double> duty,
                         std::span<const double> position_m, std::span<const double> velocity_m_s) {
  const std::size_t samples = time_s.size();
  if (samples < kFewestSamples) refuse("time_s has ", samples, " samples: record at least ", kFewestSamples);
  check_column("time_s", time_s, samples);
  if (duty.size() != samples)
    refuse("duty has ", duty.size(), " values, time_s has ", samples, ": give one per sample");
  const double dt_s = (time_s.back() - time_s.front()) / static_cast<double>(samples - 1);
  if (!(dt_s > 0)) refuse("time_s must increase, its mean step is ", dt_s);
  for (std::size_t k = 1; k < samples; ++k) {
    const double step_s = time_s[k] - time_s[k - 1];
    if (!(std::abs(step_s - dt_s) <= kEqualSteps * dt_s)) {
      refuse("time_s steps by ", step_s, " s to sample ", k, " and by ", dt_s,
             " s in the mean: resample to equal steps, within 1 %");
    }
  }
  Recording recording{dt_s,
                      {duty.begin(), duty.end()},
                      {position_m.begin(), position_m.end()},
                      {velocity_m_s.begin(), velocity_m_s.end()}};
  check(recording);
  return recording;
}

Identification identify(const Recording& recording, const IdentificationOptions& options) {
  check(recording);
  check(options, recording);
  OutputErrorSearch search(recording, options);
  std::vector<Structure> structures{Structure::first_order, Structure::second_order, Structure::fractional};
  if (options.structure) structures = {*options.structure};

  Identification result;
  for (const Structure structure : structures) {
    result.compared.push_back(fit_structure(search, recording, options, structure));
    if (result.compared.back().end == SearchEnd::cancelled) break;
  }
  std::ranges::sort(result.compared, {}, [](const Fit& fit) { return std::pair(fit.aic, fit.free_parameters); });
  result.best = result.compared.front();
  result.warnings = identifiability_warnings(recording, result.best, options.fits_offset);
  for (const Fit& fit : result.compared) {
    if (fit.structure != Structure::fractional || result.best.structure == Structure::fractional) continue;
    std::ostringstream text;
    text.precision(3);
    text << "this run does not call for fractional orders: the AIC of the " << structure_name(result.best.structure)
         << " model is lower by " << fit.aic - result.best.aic
         << "; a duty that changes faster, less noise or a longer run would tell them apart if they are there";
    result.warnings.push_back(text.str());
  }
  return result;
}

}  // namespace control
