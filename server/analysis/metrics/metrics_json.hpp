// The metrics of runs as JSON: of one run its figures and steps, of several the same beside each other.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "server/analysis/metrics/run_figures.hpp"
#include "server/storage/runs/run.hpp"

namespace server::analysis {

// Of the meaning of figures and steps: a number that changes when the same samples would give others.
inline constexpr int kMetricsVersion = 2;

nlohmann::json json_of(const std::optional<EstimateError>& error);
nlohmann::json json_of(const MeasuredStep& step);
nlohmann::json json_of(const RunMetrics& metrics);  // figures by name, steps, estimate_error

// Two figures more, missed_ticks and longest_missed_ticks: they are counted with the run's digest, which may be made
// after the metrics were stored.
void add_missed_ticks(nlohmann::json& metrics, const storage::Run& run);

// Why a step does not tell where the robot was, in a sentence; empty: ± 2 sd of its position are within the settling
// band. Of a step as JSON, as above.
std::string position_doubt(const nlohmann::json& step);
void add_position_doubts(nlohmann::json& metrics);  // each step's `position_doubt`

// Each figure, and each measure of each step, over the runs: values, mean, sd, confidence, repeatability limit. Steps
// are those of every run with the same number and cause; `documents` are what json_of(RunMetrics) gives, one for each
// run.
nlohmann::json comparison_json(std::span<const storage::Run> runs, std::span<const nlohmann::json> documents);

}  // namespace server::analysis
