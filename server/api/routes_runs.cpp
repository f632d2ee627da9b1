// Runs: begin, end, list.
#include <fmt/format.h>

#include "server/api/routes.hpp"

namespace server {
namespace {

constexpr std::int64_t kMaxRunId = 9'007'199'254'740'991;  // the largest integer that JavaScript holds

Answer list_runs(ApiParts& parts, Request request) {
  const auto limit = query_number(request, "limit", 1, kMaxLimit, kDefaultLimit);
  if (!limit) co_return problem(limit.error());
  const auto before = query_number(request, "before", 1, kMaxRunId, 0);
  if (!before) co_return problem(before.error());
  std::optional<RobotId> robot_id;
  if (const auto given = request.query.find("robot_id"); given != request.query.end()) robot_id = given->second;
  const auto runs = co_await parts.runs.list(std::move(robot_id), *before, static_cast<std::size_t>(*limit));
  co_return json_response(200, list_json("runs", runs));
}

Answer create_run(ApiParts& parts, Request request) {
  const auto wish = parse_run(request.body);
  if (!wish) co_return problem(wish.error());
  if (parts.station.find(wish->robot_id) == nullptr) {
    co_return problem(404, fmt::format("no robot '{}' is known", wish->robot_id), "unknown_robot");
  }
  const auto run = co_await parts.runs.create(wish->robot_id, wish->conditions);
  if (!run) co_return problem(run.error());
  parts.live.publish_run(to_json(*run));
  Response response = json_response(201, to_json(*run));
  response.headers.emplace_back("Location", fmt::format("/api/v1/runs/{}", run->id));
  co_return response;
}

Answer get_run(ApiParts& parts, Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return problem(id.error());
  const auto run = co_await parts.runs.find(*id);
  if (!run) co_return problem(run.error());
  co_return json_response(200, to_json(*run));
}

Answer end_run(ApiParts& parts, Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return problem(id.error());
  const auto verdict = parse_run_end(request.body);
  if (!verdict) co_return problem(verdict.error());
  const auto run = co_await parts.runs.end(*id, *verdict);
  if (!run) co_return problem(run.error());
  parts.live.publish_run(to_json(*run));
  co_return json_response(200, to_json(*run));
}

}  // namespace

Result<RunId> run_id_of(const Request& request) {
  const std::string& text = request.param.at("run_id");
  const auto id = parse_id(text);
  if (id && *id <= std::uint64_t{kMaxRunId}) return static_cast<RunId>(*id);
  return fail(ErrorCode::bad_request, fmt::format("run_id = '{}' is not a number from 1", text.substr(0, 40)),
              "out_of_range");
}

void add_run_routes(Router& router, ApiParts& parts) {
  const auto add = [&router, &parts](const char* method, const char* pattern, std::vector<std::string> query,
                                     Answer (*answer)(ApiParts&, Request)) {
    router.add({method, pattern, std::move(query),
                [&parts, answer](Request request) { return answer(parts, std::move(request)); }});
  };
  add("GET", "/api/v1/runs", {"robot_id", "before", "limit"}, list_runs);
  add("POST", "/api/v1/runs", {}, create_run);
  add("GET", "/api/v1/runs/{run_id}", {}, get_run);
  add("POST", "/api/v1/runs/{run_id}/end", {}, end_run);
}

}  // namespace server
