// Metrics of a run, computed when they are asked for and kept; several runs side by side; a run as a report.
#include <fmt/format.h>

#include <algorithm>

#include "base/json_text.hpp"
#include "server/analysis/analysis_service.hpp"
#include "server/analysis/metrics/metrics_json.hpp"
#include "server/analysis/report/run_report.hpp"
#include "server/api/analysis/analysis_routes.hpp"
#include "server/api/bodies/json.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/storage/query/history.hpp"
#include "server/storage/runs/run_digester.hpp"
#include "server/storage/runs/run_metrics.hpp"
#include "server/storage/runs/runs.hpp"

namespace server::api {
namespace asio = boost::asio;
using nlohmann::json;

namespace {

constexpr std::size_t kMostComparedRuns = 50;
constexpr std::size_t kAuditEntriesLookedAt = 1000;

struct MetricsOfRun {
  storage::Run run;
  storage::StoredMetrics metrics;
  bool is_kept = false;  // those of an open run are not
};

// What the run is measured by now; 0: by its own record.
asio::awaitable<Result<std::int64_t>> reference_time(RunMetricsRoutes parts, storage::RunId id) {
  const auto reference = co_await parts.analysis.reference(id);
  if (!reference) co_return std::unexpected{reference.error()};
  co_return *reference ? (*reference)->made_at_us : 0;
}

asio::awaitable<Result<MetricsOfRun>> metrics_of(RunMetricsRoutes parts, storage::RunId id) {
  auto run = co_await parts.runs.find(id);
  if (!run) co_return std::unexpected{run.error()};
  const auto reference_us = co_await reference_time(parts, id);
  if (!reference_us) co_return std::unexpected{reference_us.error()};
  const bool is_kept = run->state != storage::RunState::open;
  const auto samples = static_cast<std::int64_t>(run->samples_stored);
  if (is_kept) {
    auto found = co_await parts.metrics.find(id, analysis::kMetricsVersion, samples, *reference_us);
    if (found) co_return MetricsOfRun{std::move(*run), std::move(*found), true};
  }
  const auto computed = co_await parts.analysis.metrics(*run);
  if (!computed) co_return std::unexpected{computed.error()};
  const auto& reference = computed->measures.reference;
  storage::StoredMetrics made{id,
                              analysis::kMetricsVersion,
                              RHEONAUT_VERSION,
                              samples,
                              reference ? reference->made_at_us : 0,
                              parts.clock.utc_us(),
                              base::dump(analysis::json_of(*computed))};
  if (is_kept) {
    const auto stored = co_await parts.metrics.store(made);
    if (!stored) co_return std::unexpected{stored.error()};
  }
  co_return MetricsOfRun{std::move(*run), std::move(made), is_kept};
}

http::Answer get_metrics(RunMetricsRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto found = co_await metrics_of(parts, *id);
  if (!found) co_return http::problem(found.error());
  json out = json::parse(found->metrics.document, nullptr, false);
  out["run_id"] = *id;
  out["version"] = found->metrics.version;
  out["program"] = found->metrics.program;
  out["computed_at_us"] = found->metrics.computed_at_us;
  out["is_kept"] = found->is_kept;
  co_return http::json_response(200, out);
}

Result<std::vector<storage::RunId>> runs_of(const http::Request& request) {
  const auto given = request.query.find("runs");
  if (given == request.query.end())
    return fail(ErrorCode::bad_request, "runs is missing, e.g. runs=1,2", "missing_member");
  std::vector<storage::RunId> ids;
  const std::string& text = given->second;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const auto id = parse_id(text.substr(begin, end - begin));
    if (!id || *id > static_cast<std::uint64_t>(kMaxRunId)) {
      return fail(ErrorCode::bad_request, fmt::format("runs = '{}' is not a list such as 1,2", text), "out_of_range");
    }
    ids.push_back(static_cast<storage::RunId>(*id));
    begin = end + 1;
  }
  if (ids.size() >= 2 && ids.size() <= kMostComparedRuns) return ids;
  return fail(ErrorCode::bad_request, fmt::format("runs has {}, allowed are 2 to {}", ids.size(), kMostComparedRuns),
              "out_of_range");
}

http::Answer compare_runs(RunMetricsRoutes parts, http::Request request) {
  const auto ids = runs_of(request);
  if (!ids) co_return http::problem(ids.error());
  std::vector<storage::Run> runs;
  std::vector<json> documents;
  for (const storage::RunId id : *ids) {
    auto found = co_await metrics_of(parts, id);
    if (!found) co_return http::problem(found.error());
    runs.push_back(std::move(found->run));
    documents.push_back(json::parse(found->metrics.document, nullptr, false));
  }
  co_return http::json_response(200, analysis::comparison_json(runs, documents));
}

// The newest entries of the audit that are of the run.
asio::awaitable<std::vector<storage::AuditEntry>> audit_of(RunMetricsRoutes parts, const storage::Run& run) {
  storage::AuditFilter filter;
  filter.robot_id = run.robot_id;
  filter.action = "run";
  filter.limit = kAuditEntriesLookedAt;
  const std::string subject = fmt::format("{}", run.id);
  auto page = co_await parts.history.audit(std::move(filter));
  std::erase_if(page.entries, [&](const storage::AuditEntry& entry) { return entry.note.subject != subject; });
  co_return std::move(page.entries);
}

http::Answer get_report(RunMetricsRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  auto found = co_await metrics_of(parts, *id);
  if (!found) co_return http::problem(found.error());
  auto trace = co_await parts.analysis.trace(*id);
  if (!trace) co_return http::problem(trace.error());
  analysis::RunReport report;
  report.run = std::move(found->run);
  report.trace = std::move(trace->points);
  report.reference = std::move(trace->reference);
  report.metrics = json::parse(found->metrics.document, nullptr, false);
  const auto digest = co_await parts.digester.find(*id);
  if (digest && digest->is_final) report.sha256 = digest->digest.sha256;
  report.audit = co_await audit_of(parts, report.run);
  report.program = RHEONAUT_VERSION;
  report.made_at_us = parts.clock.utc_us();
  auto write = [report = std::move(report)] { return analysis::html_of(report); };
  http::Response response = http::html_response(200, co_await parts.analysis.compute(std::move(write)));
  response.headers.emplace_back("Content-Disposition", fmt::format("attachment; filename=\"run-{}.html\"", *id));
  co_return response;
}

}  // namespace

void add_run_metrics_routes(http::Router& router, RunMetricsRoutes parts) {
  const auto add = [&router, parts](const char* pattern, std::vector<std::string> query,
                                    http::Answer (*answer)(RunMetricsRoutes, http::Request)) {
    router.add({"GET", pattern, identity::Scope::read, std::move(query), with(parts, answer)});
  };
  add("/api/v1/runs/{run_id}/metrics", {}, get_metrics);
  add("/api/v1/runs/{run_id}/report.html", {}, get_report);
  add("/api/v1/run-comparison", {"runs"}, compare_runs);
}

}  // namespace server::api
