// Several runs side by side: metrics, traces, impedance over the position, all of it as a report.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "server/analysis/documents/run_documents.hpp"
#include "server/api/analysis/analysis_routes.hpp"
#include "server/api/bodies/document_body.hpp"

namespace server::api {
using nlohmann::ordered_json;

namespace {

constexpr std::size_t kMostComparedRuns = 50;

http::Answer compare_metrics(DocumentRoutes parts, http::Request request) {
  const auto runs = query_runs(request, 2, kMostComparedRuns);
  if (!runs) co_return http::problem(runs.error());
  const auto compared = co_await parts.documents.comparison(*runs);
  if (!compared) co_return http::problem(compared.error());
  co_return http::json_response(200, *compared);
}

http::Answer compare_traces(DocumentRoutes parts, http::Request request) {
  const auto runs = query_runs(request, 2, analysis::kMostAlignedRuns);
  if (!runs) co_return http::problem(runs.error());
  auto wanted = query_traces(request, *runs);
  if (!wanted) co_return http::problem(wanted.error());
  auto text = co_await parts.documents.traces_json(*runs, std::move(*wanted));
  if (!text) co_return http::problem(text.error());
  co_return http::json_text_response(200, std::move(*text));
}

http::Answer compare_impedance(DocumentRoutes parts, http::Request request) {
  const auto runs = query_runs(request, 2, analysis::kMostAlignedRuns);
  if (!runs) co_return http::problem(runs.error());
  const auto bin_m = query_bin_m(request);
  if (!bin_m) co_return http::problem(bin_m.error());
  const auto maps = co_await parts.documents.impedance_maps(*runs, *bin_m);
  if (!maps) co_return http::problem(maps.error());
  ordered_json out{{"together", json_of(maps->together)}, {"runs", ordered_json::array()}};
  for (const analysis::ImpedanceMap& map : maps->runs) out["runs"].push_back(json_of(map));
  co_return http::json_text_response(200, out.dump());
}

http::Answer comparison_as_report(DocumentRoutes parts, http::Request request) {
  const auto runs = query_runs(request, 2, analysis::kMostAlignedRuns);
  if (!runs) co_return http::problem(runs.error());
  auto wanted = query_traces(request, *runs);
  if (!wanted) co_return http::problem(wanted.error());
  auto html = co_await parts.documents.comparison_report(*runs, std::move(*wanted));
  if (!html) co_return http::problem(html.error());
  http::Response response = http::html_response(200, std::move(*html));
  response.headers.emplace_back("Content-Disposition",
                                fmt::format("attachment; filename=\"runs-{}.html\"", fmt::join(*runs, "-")));
  co_return response;
}

}  // namespace

void add_comparison_routes(http::Router& router, DocumentRoutes parts) {
  const auto add = [&router, parts](const char* pattern, std::vector<std::string> query,
                                    http::Answer (*answer)(DocumentRoutes, http::Request)) {
    router.add({"GET", pattern, identity::Scope::read, std::move(query), with(parts, answer)});
  };
  add("/api/v1/run-comparison", {"runs"}, compare_metrics);
  add("/api/v1/run-comparison/traces", traces_parameters_and_channels(), compare_traces);
  add("/api/v1/run-comparison/impedance-map", {"runs", "bin_mm"}, compare_impedance);
  add("/api/v1/run-comparison/report.html", traces_parameters(), comparison_as_report);
}

}  // namespace server::api
