// What is computed of a run for a report or an archive: its metrics, kept or made now, and the parts of its report.
#pragma once

#include <boost/asio/awaitable.hpp>

#include "server/analysis/report/run_report.hpp"
#include "server/api/analysis/analysis_routes.hpp"
#include "server/storage/runs/run_metrics.hpp"

namespace server::api {

struct MetricsOfRun {
  storage::Run run;
  storage::StoredMetrics metrics;
  bool is_kept = false;  // those of an open run are not
};

boost::asio::awaitable<Result<MetricsOfRun>> metrics_of(RunMetricsRoutes parts, storage::RunId id);

// That was made at this time, by this program.
boost::asio::awaitable<Result<analysis::RunReport>> report_of(RunMetricsRoutes parts, storage::RunId id,
                                                              std::int64_t made_at_us);

}  // namespace server::api
