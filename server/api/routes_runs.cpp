// Runs: begin, end, list, measure.
#include <fmt/format.h>

#include "server/api/routes.hpp"

namespace server {
using nlohmann::json;

namespace {

constexpr std::int64_t kMaxRunId = 9'007'199'254'740'991;  // the largest integer that JavaScript holds

Answer list_runs(ApiParts& parts, Request request) {
  const auto limit = query_number(request, "limit", 1, kMaxLimit, kDefaultLimit);
  if (!limit) co_return problem(limit.error());
  const auto before = query_number(request, "before", 1, kMaxRunId, 0);
  if (!before) co_return problem(before.error());
  std::optional<RobotId> robot_id;
  if (const auto given = request.query.find("robot_id"); given != request.query.end()) robot_id = given->second;
  const auto runs = co_await parts.recording.runs.list(std::move(robot_id), *before, static_cast<std::size_t>(*limit));
  co_return json_response(200, list_json("runs", runs));
}

Answer create_run(ApiParts& parts, Request request) {
  const auto wish = parse_run(request.body);
  if (!wish) co_return problem(wish.error());
  const Result<void> room = parts.recording.disk_watch.may_begin("a run");
  if (!room) co_return problem(room.error());
  if (parts.station.find(wish->robot_id) == nullptr) {
    co_return problem(404, fmt::format("no robot '{}' is known", wish->robot_id), "unknown_robot");
  }
  const auto run = co_await parts.recording.runs.create(wish->robot_id, wish->conditions, request.actor);
  if (!run) co_return problem(run.error());
  parts.live.publish_run(to_json(*run));
  Response response = json_response(201, to_json(*run));
  response.headers.emplace_back("Location", fmt::format("/api/v1/runs/{}", run->id));
  co_return response;
}

Answer get_run(ApiParts& parts, Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return problem(id.error());
  const auto run = co_await parts.recording.runs.find(*id);
  if (!run) co_return problem(run.error());
  co_return json_response(200, to_json(*run));
}

Answer end_run(ApiParts& parts, Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return problem(id.error());
  const auto verdict = parse_run_end(request.body);
  if (!verdict) co_return problem(verdict.error());
  const auto run = co_await parts.recording.runs.end(*id, *verdict);
  if (!run) co_return problem(run.error());
  parts.live.publish_run(to_json(*run));
  co_return json_response(200, to_json(*run));
}

json or_null(std::optional<double> value) { return value ? json(*value) : json(nullptr); }

json to_json(const MeasuredStep& step) {
  json out;
  out["cause"] = text(step.cause);
  out["span"] = step.span;
  out["first_seq"] = step.first_seq;
  out["last_seq"] = step.last_seq;
  out["at_s"] = step.at_s;
  out["start_m"] = decimal(static_cast<float>(step.start_m));
  out["target_m"] = decimal(static_cast<float>(step.target_m));
  out["band_m"] = step.band_m;
  out["settling_s"] = or_null(step.metrics.settling_s);
  out["overshoot_percent"] = step.metrics.overshoot_percent;
  out["peak_m"] = step.metrics.peak_m;
  out["rise_10_90_s"] = or_null(step.metrics.rise_10_90_s);
  out["steady_state_error_m"] = step.metrics.steady_state_error_m;
  return out;
}

Answer get_step_metrics(ApiParts& parts, Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return problem(id.error());
  const auto steps = co_await parts.analysis.steps(*id);
  if (!steps) co_return problem(steps.error());
  json list = json::array();
  for (const MeasuredStep& step : *steps) list.push_back(to_json(step));
  co_return json_response(200, {{"steps", std::move(list)}});
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
  add("GET", "/api/v1/runs/{run_id}/step-metrics", {}, get_step_metrics);
}

}  // namespace server
