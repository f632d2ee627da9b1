// Several runs as one HTML file: aligned traces, differences, metrics with their spread, conditions side by side,
// digests, and the impedance map where the robots detected something. It loads nothing and has no script.
//
// Everything that people or robots wrote is escaped. Pure and slow for long runs: call it on a worker.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/analysis/comparison/aligned_runs.hpp"
#include "server/analysis/comparison/impedance_map.hpp"
#include "server/storage/runs/run.hpp"

namespace server::analysis {

// Those of the traces that the report needs.
TraceChannels report_channels();

// Runs in the same order everywhere.
struct ComparisonReport {
  AlignedRuns aligned;  // with report_channels()
  std::vector<storage::Run> runs;
  std::vector<std::string> sha256;  // of each certificate; empty: it has none yet
  nlohmann::json comparison;        // as comparison_json() gives it
  std::optional<ImpedanceMap> map;  // of all runs together
  std::string program;              // its version
  std::int64_t made_at_us = 0;
};

std::string html_of(const ComparisonReport& report);

}  // namespace server::analysis
