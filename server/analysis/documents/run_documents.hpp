// Gathers what a document about runs needs, and has it made on a worker: metrics, traces, impedance maps, reports.
//
// Metrics of a run that has ended are kept. Runs are read one after another; `watch` gets the progress between them
// and may end it. Loop thread; the parts outlive it. Errors: those of the parts; a run that has not what it is to be
// aligned at is named.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/analysis/analysis_service.hpp"
#include "server/analysis/comparison/aligned_runs.hpp"
#include "server/analysis/comparison/impedance_map.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/storage/designs/designs.hpp"
#include "server/storage/query/history.hpp"
#include "server/storage/runs/run_digester.hpp"
#include "server/storage/runs/run_metrics.hpp"
#include "server/storage/runs/runs.hpp"

namespace server::analysis {

struct DocumentParts {
  AnalysisService& analysis;
  runtime::Clock& clock;
  storage::Designs& designs;
  storage::RunDigester& digester;
  storage::History& history;
  storage::MetricsOfRuns& metrics;
  storage::Runs& runs;
};

struct MetricsOfRun {
  storage::Run run;
  storage::StoredMetrics metrics;
  bool is_kept = false;  // those of an open run are not
};

struct ImpedanceMaps {
  ImpedanceMap together;
  std::vector<ImpedanceMap> runs;  // one for each, in their order
};

// How far it is, 0 to 1, and with which run; false ends it.
using Watch = std::function<bool(double share, const std::string& stage)>;

inline constexpr std::size_t kMaxSamplesOfComparedRun = 360'000;  // 1 h at 100 Hz

class RunDocuments {
 public:
  explicit RunDocuments(DocumentParts parts) : parts_{parts} {}

  boost::asio::awaitable<Result<MetricsOfRun>> metrics(storage::RunId run);
  // HTML, made at this UTC time; left out: now.
  boost::asio::awaitable<Result<std::string>> report(storage::RunId run, std::optional<std::int64_t> made_at_us = {});

  using RunIds = std::vector<storage::RunId>;

  // The table of metrics.
  boost::asio::awaitable<Result<nlohmann::json>> comparison(RunIds runs);
  // At most kMostAlignedRuns, each of at most kMaxSamplesOfComparedRun.
  boost::asio::awaitable<Result<AlignedRuns>> traces(RunIds runs, TracesRequest request, Watch watch = {});
  boost::asio::awaitable<Result<std::string>> traces_json(RunIds runs, TracesRequest request, Watch watch = {});
  boost::asio::awaitable<Result<ImpedanceMaps>> impedance_maps(RunIds runs, double bin_m, Watch watch = {});
  // HTML: the table, the traces and, where the robots detected something, the map. The request's channels are those of
  // the report.
  boost::asio::awaitable<Result<std::string>> comparison_report(RunIds runs, TracesRequest request, Watch watch = {});

 private:
  // 0: the run is measured by its own record.
  boost::asio::awaitable<Result<std::int64_t>> reference_time(storage::RunId run);
  boost::asio::awaitable<Result<AlignedRun>> aligned_run(storage::RunId id, const TracesRequest& request);
  boost::asio::awaitable<std::vector<storage::Design>> designs_of(storage::RunId run);
  boost::asio::awaitable<std::string> sha256_of(storage::RunId run);  // of its certificate; empty: it has none yet
  boost::asio::awaitable<std::vector<storage::AuditEntry>> audit_of(const storage::Run& run);

  DocumentParts parts_;
};

}  // namespace server::analysis
