// Names with units, as everywhere.
#include "server/analysis/metrics/metrics_json.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <functional>

#include "base/json_text.hpp"
#include "server/analysis/metrics/repeatability.hpp"

namespace server::analysis {
using nlohmann::json;

namespace {

constexpr std::array<const char*, 5> kStepMeasures{"settling_s", "overshoot_percent", "peak_m", "rise_10_90_s",
                                                   "steady_state_error_m"};

json number_or_null(const std::optional<double>& value) { return value ? json(*value) : json(nullptr); }

std::optional<double> number_in(const json& object, const char* name) {
  const json& value = object.at(name);
  return value.is_number() ? std::optional{value.get<double>()} : std::nullopt;
}

enum class Missing : std::uint8_t { not_measured, never_reached };

// The mean of the runs that settled would be better than the runs were: a time that one never reached has no mean.
json row_json(const std::vector<std::optional<double>>& values, Missing missing) {
  Repeatability over = repeatability_of(values);
  if (missing == Missing::never_reached && over.runs < values.size()) {
    over.mean = over.sd = over.confidence_half_width = over.repeatability_limit = std::nullopt;
  }
  json row{{"values", json::array()}, {"runs", over.runs}};
  for (const auto& value : values) row["values"].push_back(number_or_null(value));
  row["mean"] = number_or_null(over.mean);
  row["sd"] = number_or_null(over.sd);
  row["confidence_half_width"] = number_or_null(over.confidence_half_width);
  row["repeatability_limit"] = number_or_null(over.repeatability_limit);
  return row;
}

json figures_over(std::span<const json> documents) {
  json rows = json::array();
  for (const auto& [name, value] : documents.front().at("figures").items()) {
    std::vector<std::optional<double>> values;
    for (const json& document : documents) values.push_back(number_in(document.at("figures"), name.c_str()));
    rows.push_back(row_json(values, Missing::not_measured));
    rows.back()["name"] = name;
  }
  return rows;
}

// Whether every run has a step of this number and cause.
bool is_in_all(std::span<const json> documents, std::size_t number) {
  const json& first = documents.front().at("steps").at(number);
  return std::ranges::all_of(documents, [&](const json& document) {
    const json& steps = document.at("steps");
    return steps.size() > number && steps.at(number).at("cause") == first.at("cause");
  });
}

json steps_over(std::span<const json> documents) {
  json steps = json::array();
  for (std::size_t number = 0; number < documents.front().at("steps").size(); ++number) {
    if (!is_in_all(documents, number)) break;
    json step{{"cause", documents.front().at("steps").at(number).at("cause")}, {"measures", json::array()}};
    for (const json& document : documents) {
      step["position_source"].push_back(document.at("steps").at(number).at("position_source"));
      step["position_doubt"].push_back(position_doubt(document.at("steps").at(number)));
    }
    for (const char* measure : kStepMeasures) {
      std::vector<std::optional<double>> values;
      for (const json& document : documents) values.push_back(number_in(document.at("steps").at(number), measure));
      step["measures"].push_back(row_json(values, Missing::never_reached));
      step["measures"].back()["name"] = measure;
    }
    steps.push_back(std::move(step));
  }
  return steps;
}

// What is not the same in all runs, so that their spread is not that of repeats.
json differences(std::span<const storage::Run> runs) {
  json differing = json::array();
  const auto look = [&](const char* name, auto of) {
    const auto first = of(runs.front());
    const auto same = [&](const storage::Run& run) { return of(run) == first; };
    if (!std::ranges::all_of(runs, same)) differing.push_back(name);
  };
  look("robot_id", [](const storage::Run& run) { return run.robot_id; });
  look("fluid", [](const storage::Run& run) { return run.conditions.fluid; });
  look("pump_profile", [](const storage::Run& run) { return run.conditions.pump_profile; });
  look("mean_flow_m_s", [](const storage::Run& run) { return run.conditions.mean_flow_m_s; });
  look("tube", [](const storage::Run& run) { return run.conditions.tube; });
  look("profile", [](const storage::Run& run) { return run.conditions.profile; });
  look("controller_checksum", [](const storage::Run& run) { return run.controller_checksum; });
  look("parameters_checksum", [](const storage::Run& run) { return run.parameters_checksum; });
  look("firmware_version", [](const storage::Run& run) { return run.firmware_version; });
  return differing;
}

}  // namespace

json json_of(const std::optional<EstimateError>& error) {
  if (!error) return nullptr;
  return {{"rms_m", error->rms_m},
          {"worst_m", error->worst_m},
          {"within_2_sd", error->within_2_sd},
          {"samples", error->samples}};
}

json json_of(const MeasuredStep& step) {
  json out;
  out["cause"] = text(step.cause);
  out["span"] = step.span;
  out["first_seq"] = step.first_seq;
  out["last_seq"] = step.last_seq;
  out["at_s"] = step.at_s;
  out["start_m"] = base::decimal(static_cast<float>(step.start_m));
  out["target_m"] = base::decimal(static_cast<float>(step.target_m));
  out["band_m"] = step.band_m;
  out["position_source"] = position_source(step);
  out["position_sd_m"] = base::decimal(static_cast<float>(step.position_sd_m));
  out["estimate_error"] = json_of(step.estimate_error);
  out["settling_s"] = number_or_null(step.metrics.settling_s);
  out["overshoot_percent"] = step.metrics.overshoot_percent;
  out["peak_m"] = step.metrics.peak_m;
  out["rise_10_90_s"] = number_or_null(step.metrics.rise_10_90_s);
  out["steady_state_error_m"] = step.metrics.steady_state_error_m;
  return out;
}

json json_of(const RunMetrics& metrics) {
  json out{{"steps", json::array()}};
  for (const auto& [name, value] : metrics.figures) out["figures"][name] = number_or_null(value);
  for (const MeasuredStep& step : metrics.measures.steps) out["steps"].push_back(json_of(step));
  out["estimate_error"] = json_of(metrics.measures.estimate_error);
  return out;
}

void add_missed_ticks(json& metrics, const storage::Run& run) {
  json& figures = metrics["figures"];
  figures["missed_ticks"] = run.missed ? json(run.missed->count) : json(nullptr);
  figures["longest_missed_ticks"] = run.missed ? json(run.missed->longest) : json(nullptr);
}

// A loop that settles by its estimate has settled in its own belief, and the band is as far as it may be trusted.
std::string position_doubt(const json& step) {
  const json& sd_m = step.at("position_sd_m");
  const bool is_belief = step.at("position_source") == "estimate";
  if (!sd_m.is_number()) return "how exact the position is, is not known: this shows the belief only";
  constexpr double kMmPerM = 1e3;
  const double within_mm = 2 * kMmPerM * sd_m.get<double>(), band_mm = kMmPerM * step.at("band_m").get<double>();
  if (within_mm <= band_mm) return {};
  const auto cell = [](double value) { return fmt::format("{:.{}f}", value, value < 10 ? 1 : 0); };
  return fmt::format("± {} mm is {} times the band of {} mm: this shows {}", cell(within_mm), cell(within_mm / band_mm),
                     cell(band_mm), is_belief ? "the belief only" : "no settling within it");
}

void add_position_doubts(json& metrics) {
  for (json& step : metrics["steps"]) step["position_doubt"] = position_doubt(step);
}

json comparison_json(std::span<const storage::Run> runs, std::span<const json> documents) {
  json out{{"runs", json::array()}, {"differing_conditions", differences(runs)}};
  for (const storage::Run& run : runs) out["runs"].push_back({{"run_id", run.id}, {"name", run.conditions.name}});
  out["figures"] = figures_over(documents);
  out["steps"] = steps_over(documents);
  return out;
}

}  // namespace server::analysis
