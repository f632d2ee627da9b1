// Models and controllers that are kept: store, list, show, export, compare.
#include <fmt/format.h>

#include <algorithm>

#include "server/analysis/design_comparison.hpp"
#include "server/api/analysis/analysis_routes.hpp"
#include "server/api/bodies/design_body.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/storage/designs/designs.hpp"
#include "server/storage/jobs/jobs.hpp"

namespace server::api {
using nlohmann::json;

namespace {

constexpr std::size_t kMostCompared = 20;

Result<storage::DesignId> design_id_from(const std::string& text) {
  const auto id = parse_id(text);
  if (id && *id <= static_cast<std::uint64_t>(kMaxRunId)) return static_cast<storage::DesignId>(*id);
  return fail(ErrorCode::not_found, fmt::format("there is no design '{}'", text), "no_such_design");
}

// The runs that a job of kind identify or tune_measured was asked to use, each once.
std::vector<storage::DesignSource> sources_of(const json& asked) {
  const json one = json::array({asked});
  std::vector<storage::DesignSource> sources;
  for (const json& part : asked.contains("runs") ? asked.at("runs") : one) {
    storage::DesignSource source{part.value("run_id", storage::RunId{0}), {}};
    if (part.contains("span")) source.span = part.at("span").get<std::uint32_t>();
    if (std::ranges::find(sources, source) == sources.end()) sources.push_back(source);
  }
  return sources;
}

// The result of a job that identified a run is a model, found from that run with these options; that of one that tuned
// is a controller, designed for its model.
boost::asio::awaitable<Result<void>> take_result(DesignRoutes parts, storage::JobId id,
                                                 storage::DesignRequest& request) {
  const auto job = co_await parts.jobs.find(id);
  if (!job) co_return std::unexpected{job.error()};
  const auto result = co_await parts.jobs.result(id);
  if (!result) {
    co_return fail(ErrorCode::conflict, fmt::format("job {} has no result, it is {}", id, text(job->state)),
                   "no_result");
  }
  const json document = json::parse(*result, nullptr, false);
  if (const auto checked = analysis::check_document(request.kind, document); !checked) {
    co_return std::unexpected{checked.error()};
  }
  request.document = *result;
  request.options = job->request.document;
  const json asked = json::parse(job->request.document, nullptr, false);
  const bool is_of_runs = job->request.kind == "identify" || job->request.kind == "tune_measured";
  if (is_of_runs) request.sources = sources_of(asked);
  const bool is_controller = request.kind == storage::DesignKind::controller;
  if (is_controller && !request.model && asked.contains("model_id")) {
    request.model = asked.at("model_id").get<storage::DesignId>();
  }
  co_return Result<void>{};
}

http::Answer store_design(DesignRoutes parts, http::Request request) {
  auto body = parse_design(request.body);
  if (!body) co_return http::problem(body.error());
  if (body->job) {
    const auto taken = co_await take_result(parts, *body->job, body->request);
    if (!taken) co_return http::problem(taken.error());
  }
  const auto stored = co_await parts.designs.store(std::move(body->request), author_of(request, parts.clock));
  if (!stored) co_return http::problem(stored.error());
  http::Response response = http::json_response(201, to_json(*stored));
  response.headers.emplace_back("Location", fmt::format("/api/v1/designs/{}", stored->id));
  co_return response;
}

http::Answer list_designs(DesignRoutes parts, http::Request request) {
  const auto limit = query_limit(request);
  if (!limit) co_return http::problem(limit.error());
  const auto before = query_number_cursor(request, "before");
  if (!before) co_return http::problem(before.error());
  const auto run = query_number(request, "run_id", 1, kMaxRunId, 0);
  if (!run) co_return http::problem(run.error());
  storage::DesignFilter filter;
  filter.before = *before;
  filter.limit = *limit + 1;
  if (*run != 0) filter.run = *run;
  if (const auto given = request.query.find("kind"); given != request.query.end()) {
    filter.kind = storage::design_kind_from(given->second);
    if (!filter.kind) co_return http::problem(400, "kind is none of model and controller", "out_of_range");
  }
  const auto designs = co_await parts.designs.list(filter);
  const auto json_of = [](const storage::Design& design) { return to_json(design); };
  const auto cursor_of = [](const storage::Design& design) { return design.id; };
  co_return http::json_response(200, page_json("designs", designs, *limit, json_of, cursor_of));
}

http::Answer get_design(DesignRoutes parts, http::Request request) {
  const auto id = design_id_from(request.param.at("design_id"));
  if (!id) co_return http::problem(id.error());
  const auto design = co_await parts.designs.find(*id);
  if (!design) co_return http::problem(design.error());
  json out = to_json(*design);
  out["document"] = json::parse(design->made.document, nullptr, false);
  out["ancestors"] = json::array();
  const auto ancestors = co_await parts.designs.ancestors(*id);
  for (const storage::Design& ancestor : ancestors) out["ancestors"].push_back(to_json(ancestor));
  const auto made_with = co_await parts.designs.runs_made_with(*id);
  out["runs_made_with"] = made_with;
  co_return http::json_response(200, out);
}

http::Answer export_design(DesignRoutes parts, http::Request request) {
  const auto id = design_id_from(request.param.at("design_id"));
  if (!id) co_return http::problem(id.error());
  const auto design = co_await parts.designs.find(*id);
  if (!design) co_return http::problem(design.error());
  http::Response response = http::json_text_response(200, design->made.document);
  response.headers.emplace_back(
      "Content-Disposition", fmt::format("attachment; filename=\"{}-{}.json\"", text(design->made.kind), design->id));
  co_return response;
}

Result<std::vector<storage::DesignId>> ids_of(const http::Request& request) {
  const auto given = request.query.find("ids");
  if (given == request.query.end())
    return fail(ErrorCode::bad_request, "ids is missing, e.g. ids=1,2", "missing_member");
  std::vector<storage::DesignId> ids;
  const std::string& text = given->second;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const auto id = design_id_from(text.substr(begin, end - begin));
    if (!id) return std::unexpected{id.error()};
    ids.push_back(*id);
    begin = end + 1;
  }
  if (ids.size() >= 2 && ids.size() <= kMostCompared) return ids;
  return fail(ErrorCode::bad_request, fmt::format("ids has {}, allowed are 2 to {}", ids.size(), kMostCompared),
              "out_of_range");
}

http::Answer compare_designs(DesignRoutes parts, http::Request request) {
  const auto ids = ids_of(request);
  if (!ids) co_return http::problem(ids.error());
  std::vector<storage::Design> designs;
  for (const storage::DesignId id : *ids) {
    auto design = co_await parts.designs.find(id);
    if (!design) co_return http::problem(design.error());
    designs.push_back(std::move(*design));
  }
  const auto comparison = analysis::comparison_json(designs);
  if (!comparison) co_return http::problem(comparison.error());
  co_return http::json_text_response(200, comparison->dump());
}

}  // namespace

void add_design_routes(http::Router& router, DesignRoutes parts) {
  const auto add = [&router, parts](const char* method, const char* pattern, identity::Scope needs,
                                    std::vector<std::string> query,
                                    http::Answer (*answer)(DesignRoutes, http::Request)) {
    router.add({method, pattern, needs, std::move(query), with(parts, answer)});
  };
  add("POST", "/api/v1/designs", identity::Scope::record, {}, store_design);
  add("GET", "/api/v1/designs", identity::Scope::read, {"before", "kind", "limit", "run_id"}, list_designs);
  add("GET", "/api/v1/designs/{design_id}", identity::Scope::read, {}, get_design);
  add("GET", "/api/v1/designs/{design_id}/document", identity::Scope::read, {}, export_design);
  add("GET", "/api/v1/design-comparison", identity::Scope::read, {"ids"}, compare_designs);
}

}  // namespace server::api
