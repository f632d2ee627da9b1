// Adds to the result of control/ what the recording says.
#include "server/analysis/identification_answer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/invalid_argument.hpp"
#include "control/identification/recording_checks.hpp"

namespace server::analysis {
namespace {

constexpr double kLargerThanSaid = 1.5;  // residuals, in sd of the reference
constexpr double kSuspiciousClockS = 0.005;

// What a position from outside adds to the doubts about a fit.
void add_outside_doubts(const RunRecording& recorded, const control::IdentificationOptions& options,
                        const control::Fit& best, std::vector<std::string>& warnings) {
  if (!(recorded.position_sd_m > 0)) return;
  const double residual_sd_m = best.residual_sd;
  if (residual_sd_m > kLargerThanSaid * recorded.position_sd_m) {
    warnings.push_back(fmt::format(
        "the residuals, {:.2g} mm, are larger than the position from outside is said to be exact, {:.2g} mm: "
        "its clock, its scale or the model is not right",
        1e3 * residual_sd_m, 1e3 * recorded.position_sd_m));
  }
  // A dead time of the plant and a camera's clock that is ahead look the same: positions come late after the duty.
  const double clock_sigma_s = best.position_clock_sigma_s.value_or(0);
  const std::string& name = options.names.dead_time;
  const std::string option = name.empty() ? name : fmt::format(" ({})", name);
  if (std::abs(best.position_clock_s) > std::max(kSuspiciousClockS, 3 * clock_sigma_s)) {
    warnings.push_back(fmt::format(
        "the outside position's clock came out {:.0f} ms off: {}", 1e3 * best.position_clock_s,
        best.position_clock_s < 0
            ? "if it is not, that is a dead time of the plant; search for it" + option
            : "the positions come before the duty that moves the robot, as no plant does; correct the clock's offset"));
  }
  if (options.longest_dead_time_s > 0 || best.model.dead_time_s > 0) {
    warnings.emplace_back("the dead time contains what is left of the error of the outside position's clock");
  }
}

// In metres, also of positions that are weighed in the fit.
OrderedJson residuals_json(const control::Fit& fit, const RunRecording& recorded) {
  std::vector<double> position_m = fit.position_residual_m;
  const std::vector<double>& sd_m = recorded.recording.position_sd_m;
  for (std::size_t i = 0; i < sd_m.size(); ++i) position_m[i] *= sd_m[i] / recorded.position_sd_m;
  return {{"position_m", position_m},
          {"velocity_m_s", fit.velocity_residual_m_s},
          {"acceleration_m_s2", fit.acceleration_residual_m_s2}};
}

// The order of the keys is that of the answer for one run.
OrderedJson run_json(const RunOfMany& of, const control::JointRun& run, bool with_residuals) {
  OrderedJson answer = {{"run_id", of.run},
                        {"channels", channels_of(of.recorded.recording)},
                        {"channels_reason", of.recorded.channels_reason}};
  const OrderedJson fit = json_of(run.fit);
  for (const char* key : {"sse", "fit_percent", "residual_sd", "offset_m", "offset_sigma_m", "position_clock_s",
                          "position_clock_sigma_s", "residuals_are_white", "whiteness_p_value", "sensor"}) {
    answer[key] = fit.at(key);
  }
  if (const auto chi_square = chi_square_of(of.recorded, run.fit)) {
    answer["position_chi_square"] = chi_square->value;
    answer["position_degrees_of_freedom"] = chi_square->degrees_of_freedom;
  }
  answer["warnings"] = run.warnings;
  if (with_residuals) answer["residuals"] = residuals_json(run.fit, of.recorded);
  return answer;
}

// Of the recording of one run, so that the refusal names it.
void check_run(const RunOfMany& run) {
  try {
    control::check_recording(run.recorded.recording);
  } catch (const std::invalid_argument& error) {
    base::throw_invalid("run ", run.run, ": ", error.what());
  }
}

}  // namespace

std::vector<std::string> channels_of(const control::Recording& recording) {
  std::vector<std::string> names;
  if (!recording.position_m.empty()) names.emplace_back("position_m");
  if (!recording.velocity_m_s.empty()) names.emplace_back("velocity_m_s");
  if (!recording.acceleration_m_s2.empty()) names.emplace_back("acceleration_m_s2");
  return names;
}

control::Identification identify_run(const RunRecording& recorded, const control::IdentificationOptions& options) {
  control::Identification found = control::identify(recorded.recording, options);
  if (is_out_of_time(found.best)) return found;
  found.warnings.insert(found.warnings.end(), recorded.warnings.begin(), recorded.warnings.end());
  add_outside_doubts(recorded, options, found.best, found.warnings);
  return found;
}

std::optional<ChiSquare> chi_square_of(const RunRecording& recorded, const control::Fit& fit) {
  const auto positions = static_cast<double>(fit.position_residual_m.size());
  if (!(recorded.position_sd_m > 0) || !std::isfinite(fit.residual_sd)) return std::nullopt;
  const double relative_sd = fit.residual_sd / recorded.position_sd_m;
  return ChiSquare{positions * relative_sd * relative_sd, positions - fit.free_parameters};
}

std::optional<control::EstimatorModel> estimator_of(const control::Fit& fit) {
  if (!std::isfinite(fit.sse)) return std::nullopt;
  return control::estimator_model(fit.model);
}

OrderedJson answer_json(const RunRecording& recorded, const control::Identification& found, bool with_residuals) {
  OrderedJson answer = json_of(found);
  const auto estimator = estimator_of(found.best);
  answer["estimator"] = estimator ? json_of(*estimator) : OrderedJson{};
  answer["channels"] = channels_of(recorded.recording);
  answer["channels_reason"] = recorded.channels_reason;
  if (const auto chi_square = chi_square_of(recorded, found.best)) {
    answer["position_chi_square"] = chi_square->value;
    answer["position_degrees_of_freedom"] = chi_square->degrees_of_freedom;
  }
  if (with_residuals) answer["residuals"] = residuals_json(found.best, recorded);
  return answer;
}

control::Identification identify_runs(std::span<const RunOfMany> runs, const control::IdentificationOptions& options) {
  std::vector<control::Recording> recordings;
  for (const RunOfMany& run : runs) {
    check_run(run);
    recordings.push_back(run.recorded.recording);
  }
  control::Identification found = control::identify_together(recordings, options);
  if (is_out_of_time(found.best)) return found;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    control::JointRun& run = found.runs[i];
    const std::vector<std::string>& of_recording = runs[i].recorded.warnings;
    run.warnings.insert(run.warnings.end(), of_recording.begin(), of_recording.end());
    add_outside_doubts(runs[i].recorded, options, run.fit, run.warnings);
  }
  return found;
}

OrderedJson answer_json(std::span<const RunOfMany> runs, const control::Identification& found, bool with_residuals) {
  OrderedJson answer = json_of(found);
  const auto estimator = estimator_of(found.best);
  answer["estimator"] = estimator ? json_of(*estimator) : OrderedJson{};
  answer["runs"] = OrderedJson::array();
  for (std::size_t i = 0; i < runs.size(); ++i) {
    answer["runs"].push_back(run_json(runs[i], found.runs[i], with_residuals));
  }
  return answer;
}

std::vector<std::string> warnings_of_runs(std::span<const RunOfMany> runs, const control::Identification& found) {
  std::vector<std::string> all;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    for (const std::string& warning : found.runs[i].warnings) {
      all.push_back(fmt::format("run {}: {}", runs[i].run, warning));
    }
  }
  return all;
}

}  // namespace server::analysis
