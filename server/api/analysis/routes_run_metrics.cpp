// Metrics of a run, computed when they are asked for and kept; several runs side by side; a run as a report.
#include <fmt/format.h>

#include <algorithm>

#include "base/json_text.hpp"
#include "server/analysis/analysis_service.hpp"
#include "server/analysis/metrics/metrics_json.hpp"
#include "server/analysis/report/run_report.hpp"
#include "server/api/analysis/analysis_routes.hpp"
#include "server/api/analysis/run_documents.hpp"
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

http::Answer get_report(RunMetricsRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  auto report = co_await report_of(parts, *id, parts.clock.utc_us());
  if (!report) co_return http::problem(report.error());
  auto write = [report = std::move(*report)] { return analysis::html_of(report); };
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
