// Runs: begin, end, make afterwards, annotate, discard, make final, list, digest, measure.
#include <fmt/format.h>

#include "server/analysis/analysis_service.hpp"
#include "server/analysis/metrics/metrics_json.hpp"
#include "server/api/bodies/json.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/api/bodies/run_json.hpp"
#include "server/api/routes/routes.hpp"
#include "server/identity/auth.hpp"
#include "server/live/live_feed.hpp"
#include "server/station/station.hpp"
#include "server/storage/finalizing/run_finalizer.hpp"
#include "server/storage/runs/run_digester.hpp"
#include "server/storage/runs/runs.hpp"
#include "server/storage/upkeep/disk_watch.hpp"

namespace server::api {
using nlohmann::json;

namespace {

http::Answer list_runs(RunRoutes parts, http::Request request) {
  const auto limit = query_limit(request);
  if (!limit) co_return http::problem(limit.error());
  const auto before = query_number_cursor(request, "before");
  if (!before) co_return http::problem(before.error());
  storage::RunFilter filter;
  filter.before = *before;
  filter.limit = *limit + 1;
  auto robot = query_robot(request);
  if (!robot) co_return http::problem(robot.error());
  filter.robot_id = std::move(*robot);
  if (const auto given = request.query.find("state"); given != request.query.end()) {
    filter.state = storage::run_state_from(given->second);
    if (!filter.state) {
      co_return http::problem(400, "state is none of open, ended, interrupted and discarded", "out_of_range");
    }
  }
  const auto runs = co_await parts.runs.list(std::move(filter));
  const auto json_of = [](const storage::Run& run) { return api::to_json(run); };
  const auto cursor_of = [](const storage::Run& run) { return run.id; };
  co_return http::json_response(200, page_json("runs", runs, *limit, json_of, cursor_of));
}

// SAFETY: the fluid named for a robot decides which limits hold and which model it is sent, so naming it is a command.
// False when the caller may not command but names the present fluid: then nothing changes for the robot.
Result<bool> may_name_fluid(const RunRoutes& parts, const http::Request& request, const station::RobotId& robot_id,
                            const std::string& fluid) {
  if (fluid.empty() || request.caller.scopes.allow(identity::Scope::command)) return true;
  const station::RobotState* robot = parts.station.find(robot_id);
  const auto listed = parts.station.envelope().listed(fluid);
  if (robot == nullptr || !listed) return true;  // refused later
  if (robot->fluid == *listed) return false;
  return fail(ErrorCode::forbidden,
              fmt::format("to say that robot '{}' is in '{}' changes its limits, which needs the scope command; name "
                          "the fluid that it is in, or none",
                          robot_id, *listed),
              "not_permitted");
}

http::Answer create_run(RunRoutes parts, http::Request request) {
  auto run_request = parse_run(request.body);
  if (!run_request) co_return http::problem(run_request.error());
  const Result<void> room = parts.disk_watch.may_begin("a run");
  if (!room) co_return http::problem(room.error());
  if (parts.station.find(run_request->robot_id) == nullptr) {
    co_return http::problem(404, fmt::format("no robot '{}' is known", run_request->robot_id), "unknown_robot");
  }
  if (!run_request->range) {
    const auto named = may_name_fluid(parts, request, run_request->robot_id, run_request->conditions.fluid);
    if (!named) co_return http::problem(named.error(), least_role(identity::Scope::command));
    if (!*named) run_request->conditions.fluid.clear();  // the run takes the robot's
  }
  storage::Runs& runs = parts.runs;
  const station::Author by = author_of(request, parts.clock);
  auto made = run_request->range
                  ? runs.make_afterwards(run_request->robot_id, run_request->conditions, *run_request->range, by)
                  : runs.create(run_request->robot_id, run_request->conditions, by);
  const auto run = co_await std::move(made);
  if (!run) co_return http::problem(run.error());
  http::Response response = http::json_response(201, api::to_json(*run));
  response.headers.emplace_back("Location", fmt::format("/api/v1/runs/{}", run->id));
  co_return response;
}

http::Answer get_run(RunRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto run = co_await parts.runs.find(*id);
  if (!run) co_return http::problem(run.error());
  co_return http::json_response(200, api::to_json(*run));
}

http::Answer end_run(RunRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto verdict = parse_run_end(request.body);
  if (!verdict) co_return http::problem(verdict.error());
  const auto run = co_await parts.runs.end(*id, *verdict, author_of(request, parts.clock));
  if (!run) co_return http::problem(run.error());
  co_return http::json_response(200, api::to_json(*run));
}

http::Answer annotate_run(RunRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  auto annotation = parse_annotation(request.body);
  if (!annotation) co_return http::problem(annotation.error());
  if (const auto fluid = annotation->texts.find("fluid"); fluid != annotation->texts.end()) {
    const auto before = co_await parts.runs.find(*id);
    if (!before) co_return http::problem(before.error());
    if (auto stands = still_stands(request.caller); !stands) co_return http::problem(stands.error());
    const bool is_open = before->state == storage::RunState::open;
    const auto named = is_open ? may_name_fluid(parts, request, before->robot_id, fluid->second) : Result<bool>{true};
    if (!named) co_return http::problem(named.error(), least_role(identity::Scope::command));
    annotation->names_fluid_of_robot = *named;
  }
  const auto run = co_await parts.runs.annotate(*id, *annotation, author_of(request, parts.clock));
  if (!run) co_return http::problem(run.error());
  co_return http::json_response(200, api::to_json(*run));
}

http::Answer discard_run(RunRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto reason = parse_discard(request.body);
  if (!reason) co_return http::problem(reason.error());
  const auto run = co_await parts.runs.discard(*id, *reason, author_of(request, parts.clock));
  if (!run) co_return http::problem(run.error());
  co_return http::json_response(200, api::to_json(*run));
}

http::Answer finalize_run(RunRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto missing = parse_finalize(request.body);
  if (!missing) co_return http::problem(missing.error());
  const auto given_up = co_await parts.finalizer.finalize(*id, *missing, author_of(request, parts.clock));
  if (!given_up) co_return http::problem(given_up.error());
  const auto digest = co_await parts.digester.find(*id);
  if (!digest) co_return http::problem(digest.error());
  const auto run = co_await parts.runs.find(*id);
  if (run) parts.live.publish_run(api::to_json(*run));
  json answer = api::to_json(*digest, *id);
  answer["samples_given_up"] = *given_up;
  co_return http::json_response(200, answer);
}

http::Answer get_digest(RunRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto digest = co_await parts.digester.find(*id);
  if (!digest) co_return http::problem(digest.error());
  co_return http::json_response(200, api::to_json(*digest, *id));
}

http::Answer get_snapshot(RunRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto snapshot = co_await parts.runs.snapshot(*id);
  if (!snapshot) co_return http::problem(snapshot.error());
  co_return http::json_response(200, api::to_json(*snapshot));
}

http::Answer get_step_metrics(RunRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto measures = co_await parts.analysis.measures(*id);
  if (!measures) co_return http::problem(measures.error());
  json list = json::array();
  for (const analysis::MeasuredStep& step : measures->steps) list.push_back(analysis::json_of(step));
  json out{{"steps", std::move(list)}};
  out["reference"] = measures->reference ? analysis::json_of(*measures->reference) : json(nullptr);
  out["estimate_error"] = analysis::json_of(measures->estimate_error);
  co_return http::json_response(200, out);
}

}  // namespace

void add_run_routes(http::Router& router, RunRoutes parts) {
  const auto add = [&router, parts](const char* method, const char* pattern, identity::Scope needs,
                                    std::vector<std::string> query, http::Answer (*answer)(RunRoutes, http::Request)) {
    router.add({method, pattern, needs, std::move(query), with(parts, answer)});
  };
  add("GET", "/api/v1/runs", identity::Scope::read, {"robot_id", "state", "before", "limit"}, list_runs);
  add("POST", "/api/v1/runs", identity::Scope::record, {}, create_run);
  add("GET", "/api/v1/runs/{run_id}", identity::Scope::read, {}, get_run);
  add("POST", "/api/v1/runs/{run_id}/end", identity::Scope::record, {}, end_run);
  add("POST", "/api/v1/runs/{run_id}/annotate", identity::Scope::record, {}, annotate_run);
  add("POST", "/api/v1/runs/{run_id}/discard", identity::Scope::record, {}, discard_run);
  add("POST", "/api/v1/runs/{run_id}/finalize", identity::Scope::admin, {}, finalize_run);
  add("GET", "/api/v1/runs/{run_id}/certificate", identity::Scope::read, {}, get_digest);
  add("GET", "/api/v1/runs/{run_id}/snapshot", identity::Scope::read, {}, get_snapshot);
  add("GET", "/api/v1/runs/{run_id}/step-metrics", identity::Scope::read, {}, get_step_metrics);
}

}  // namespace server::api
