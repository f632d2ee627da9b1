// Metrics of a run, computed when they are asked for and kept; a run as a report; its impedance over the position.
#include <fmt/format.h>

#include "server/analysis/documents/run_documents.hpp"
#include "server/analysis/metrics/metrics_json.hpp"
#include "server/api/analysis/analysis_routes.hpp"
#include "server/api/bodies/document_body.hpp"
#include "server/api/bodies/query_params.hpp"

namespace server::api {
using nlohmann::json;

namespace {

http::Answer get_metrics(DocumentRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto found = co_await parts.documents.metrics(*id);
  if (!found) co_return http::problem(found.error());
  json out = json::parse(found->metrics.document, nullptr, false);
  analysis::add_position_doubts(out);
  out["run_id"] = *id;
  out["version"] = found->metrics.version;
  out["program"] = found->metrics.program;
  out["computed_at_us"] = found->metrics.computed_at_us;
  out["is_kept"] = found->is_kept;
  co_return http::json_response(200, out);
}

http::Answer get_report(DocumentRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  auto html = co_await parts.documents.report(*id);
  if (!html) co_return http::problem(html.error());
  http::Response response = http::html_response(200, std::move(*html));
  response.headers.emplace_back("Content-Disposition", fmt::format("attachment; filename=\"run-{}.html\"", *id));
  co_return response;
}

http::Answer get_impedance_map(DocumentRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto bin_m = query_bin_m(request);
  if (!bin_m) co_return http::problem(bin_m.error());
  const std::vector<storage::RunId> runs(1, *id);
  const auto maps = co_await parts.documents.impedance_maps(runs, *bin_m);
  if (!maps) co_return http::problem(maps.error());
  co_return http::json_text_response(200, json_of(maps->together).dump());
}

}  // namespace

void add_run_metrics_routes(http::Router& router, DocumentRoutes parts) {
  const auto add = [&router, parts](const char* pattern, std::vector<std::string> query,
                                    http::Answer (*answer)(DocumentRoutes, http::Request)) {
    router.add({"GET", pattern, identity::Scope::read, std::move(query), with(parts, answer)});
  };
  add("/api/v1/runs/{run_id}/metrics", {}, get_metrics);
  add("/api/v1/runs/{run_id}/report.html", {}, get_report);
  add("/api/v1/runs/{run_id}/impedance-map", {"bin_mm"}, get_impedance_map);
}

}  // namespace server::api
