// A run as one HTML file: conditions, what it was made with, plots, metrics, what was designed from it, digest, audit.
// It loads nothing and has no script.
//
// Everything that people or robots wrote is escaped. Pure and slow for long runs: call it on a worker.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/analysis/comparison/trace.hpp"
#include "server/storage/audit/audit_chain.hpp"
#include "server/storage/runs/outside_reference.hpp"
#include "server/storage/runs/run.hpp"

namespace server::analysis {

// A model that was found from the run, or a controller that was designed for one.
struct DesignOfRun {
  std::int64_t number = 0;
  std::string kind, name;
  std::string doubts;  // about the model, in a line; empty: none, or nobody has said
};

// A controller that the run was made with, and the model that it was designed for.
struct ControllerInReport {
  std::int64_t number = 0;
  std::string name, sha256;
  std::optional<DesignOfRun> model;
  std::vector<std::int64_t> model_runs;  // that the model was found from
};

struct RunReport {
  storage::Run run;
  std::vector<TracePoint> trace;
  std::optional<storage::StoredReference> reference;
  nlohmann::json metrics;            // as json_of(RunMetrics) gives them
  std::vector<DesignOfRun> designs;  // newest first
  std::vector<ControllerInReport> made_with;
  std::string sha256;                      // of the run's certificate; empty: it has none yet
  std::vector<storage::AuditEntry> audit;  // of the run, newest first
  std::string program;                     // its version
  std::int64_t made_at_us = 0;
};

std::string html_of(const RunReport& report);

}  // namespace server::analysis
