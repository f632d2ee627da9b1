// Experiments and profiles: begin, list, watch, keep alive, pause, resume, abort, take over, move.
#include <fmt/format.h>

#include <algorithm>

#include "server/analysis/analysis_service.hpp"
#include "server/analysis/tuning/controller_document.hpp"
#include "server/api/bodies/controller_body.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/api/experiments/experiment_json.hpp"
#include "server/api/experiments/experiment_routes.hpp"
#include "server/experiments/profile_document.hpp"
#include "server/identity/auth.hpp"
#include "server/storage/designs/designs.hpp"

namespace server::api {
using nlohmann::json;

namespace {

constexpr std::int64_t kMaxWait_ms = 30'000;

Result<storage::ExperimentId> experiment_id_of(const http::Request& request) {
  const std::string& given = request.param.at("experiment_id");
  const auto id = parse_id(given);
  if (id && *id <= static_cast<std::uint64_t>(kMaxRunId)) return static_cast<storage::ExperimentId>(*id);
  return fail(ErrorCode::not_found, fmt::format("there is no experiment '{}'", given), "no_such_experiment");
}

// SAFETY: what a script asks for an experiment is a sign of life of it for that experiment, as old as the request or as
// what it has seen of the station; a page gives its own by the stamps on /live.
std::optional<std::int64_t> seen_at(const ExperimentRoutes& parts, const http::Request& request) {
  if (request.caller.session != 0) return std::nullopt;
  return parts.clock.steady_us() - request.unread.count();
}

http::Response view_response(int status, const Result<experiments::ExperimentView>& view) {
  return view ? http::json_response(status, to_json(*view)) : http::problem(view.error());
}

// Who may stop and not read sees what became of it, and nothing else.
http::Response stop_response(const http::Request& request, const Result<experiments::ExperimentView>& view) {
  if (!view || request.caller.scopes.allow(identity::Scope::read)) return view_response(200, view);
  return http::json_response(200, {{"experiment_id", view->experiment.id}, {"state", text(view->experiment.state)}});
}

http::Answer begin_experiment(ExperimentRoutes parts, http::Request request) {
  auto body = parse_experiment(request.body);
  if (!body) co_return http::problem(body.error());
  if (auto stands = still_stands(request.caller); !stands) co_return http::problem(stands.error());
  const auto seen_at_us = seen_at(parts, request);
  const auto begun = co_await parts.experiments.begin(std::move(*body), author_of(request, parts.clock), seen_at_us);
  http::Response response = view_response(202, begun);
  if (begun) {
    response.headers.emplace_back("Location", fmt::format("/api/v1/experiments/{}", begun->experiment.id));
  }
  co_return response;
}

http::Answer list_experiments(ExperimentRoutes parts, http::Request request) {
  const auto limit = query_limit(request);
  if (!limit) co_return http::problem(limit.error());
  const auto before = query_number_cursor(request, "before");
  if (!before) co_return http::problem(before.error());
  storage::ExperimentFilter filter;
  filter.before = *before;
  filter.limit = *limit + 1;
  auto robot = query_robot(request);
  if (!robot) co_return http::problem(robot.error());
  filter.robot_id = std::move(*robot);
  if (const auto given = request.query.find("state"); given != request.query.end()) {
    filter.state = storage::experiment_state_from(given->second);
    if (!filter.state) co_return http::problem(400, "state is none that an experiment has", "out_of_range");
  }
  const auto views = co_await parts.experiments.list(std::move(filter));
  const auto json_of = [](const experiments::ExperimentView& view) { return summary_json(view); };
  const auto cursor_of = [](const experiments::ExperimentView& view) { return view.experiment.id; };
  co_return http::json_response(200, page_json("experiments", views, *limit, json_of, cursor_of));
}

http::Answer get_experiment(ExperimentRoutes parts, http::Request request) {
  const auto id = experiment_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto wait_ms = query_number(request, "wait_ms", 0, kMaxWait_ms, 0);
  if (!wait_ms) co_return http::problem(wait_ms.error());
  const microseconds patience{*wait_ms * 1000};
  const auto view = co_await parts.experiments.wait_for_change(*id, patience);
  if (!view) co_return http::problem(view.error());
  json out = to_json(*view);
  out["profile"] = view->experiment.request.profile;
  co_return http::json_response(200, out);
}

http::Answer get_prediction(ExperimentRoutes parts, http::Request request) {
  const auto id = experiment_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto number = parse_id(request.param.at("number"));
  if (number && *number <= experiments::kMostRuns) {
    auto found = co_await parts.experiments.prediction(*id, static_cast<std::uint32_t>(*number));
    if (found) co_return http::json_text_response(200, std::move(*found));
  }
  co_return http::problem(
      404, fmt::format("there is no prediction of run '{}' of this experiment", request.param.at("number")),
      "no_prediction");
}

http::Answer keep_alive(ExperimentRoutes parts, http::Request request) {
  const auto id = experiment_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto stamp_us = parse_keep_alive(request.body);
  if (!stamp_us) co_return http::problem(stamp_us.error());
  const std::int64_t now_us = parts.clock.steady_us();
  const auto view = parts.experiments.summary(*id);
  if (!view) {
    const auto ended = co_await parts.experiments.find(*id);
    co_return ended ? http::problem(409, "it has ended", "wrong_state") : http::problem(ended.error());
  }
  const std::string& actor = view->experiment.acts_for;
  if (actor != request.actor) {
    co_return http::problem(409, fmt::format("it acts in the name of {}", actor), "acts_for_another");
  }
  if (view->experiment.client != request.caller.client) {
    co_return http::problem(
        409,
        fmt::format("it is in the hands of another page or program of {}; take it over, or resume it where it is held",
                    actor),
        "acts_for_another");
  }
  // A stamp of the future is of an earlier boot of the machine: as old as can be.
  const bool is_of_this_boot = !*stamp_us || **stamp_us <= now_us;
  const microseconds age{*stamp_us ? now_us - **stamp_us : 0};
  if (is_of_this_boot && request.caller.session == 0) {
    parts.experiments.keep_alive(*id, {request.actor, request.caller.client}, std::max(request.unread, age));
  }
  json out = summary_json(*view);
  out["stamp_us"] = now_us;
  co_return http::json_response(200, std::move(out));
}

http::Answer pause_experiment(ExperimentRoutes parts, http::Request request) {
  const auto id = experiment_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto view = co_await parts.experiments.pause(*id, author_of(request, parts.clock));
  co_return stop_response(request, view);
}

http::Answer resume_experiment(ExperimentRoutes parts, http::Request request) {
  const auto id = experiment_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto seen_at_us = seen_at(parts, request);
  const auto view = co_await parts.experiments.resume(*id, author_of(request, parts.clock), seen_at_us);
  co_return view_response(200, view);
}

http::Answer abort_experiment(ExperimentRoutes parts, http::Request request) {
  const auto id = experiment_id_of(request);
  if (!id) co_return http::problem(id.error());
  auto reason = parse_abort(request.body);
  if (!reason) co_return http::problem(reason.error());
  const auto view = co_await parts.experiments.abort(*id, std::move(*reason), author_of(request, parts.clock));
  co_return stop_response(request, view);
}

http::Answer take_over_experiment(ExperimentRoutes parts, http::Request request) {
  const auto id = experiment_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto seen_at_us = seen_at(parts, request);
  const auto view = co_await parts.experiments.take_over(*id, author_of(request, parts.clock), seen_at_us);
  co_return view_response(200, view);
}

http::Answer move_experiment(ExperimentRoutes parts, http::Request request) {
  const auto id = experiment_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto move = parse_move(request.body);
  if (!move) co_return http::problem(move.error());
  const auto view = co_await parts.experiments.move(*id, move->before, move->priority, author_of(request, parts.clock));
  co_return view_response(200, view);
}

http::Answer list_profiles(ExperimentRoutes, http::Request) {
  json list = json::array();
  for (const base::EmbeddedFile& shipped : experiments::shipped_profiles()) {
    const experiments::Profile profile = experiments::find_profile(std::string{shipped.name});
    list.push_back({{"profile", shipped.name},
                    {"name", profile.name},
                    {"purpose", profile.purpose},
                    {"runs", profile.until ? profile.most_runs : experiments::variants_of(profile).size()},
                    {"duration_s", experiments::longest_duration_s(profile)}});
  }
  co_return http::json_response(200, {{"profiles", std::move(list)}});
}

http::Answer get_profile(ExperimentRoutes, http::Request request) {
  const std::string& name = request.param.at("profile");
  for (const base::EmbeddedFile& shipped : experiments::shipped_profiles()) {
    if (shipped.name == name) {
      co_return http::json_response(200, {{"profile", name}, {"document", std::string{shipped.content}}});
    }
  }
  co_return http::problem(404, fmt::format("there is no profile '{}'", name.substr(0, 40)), "no_such_profile");
}

// The newest of a name, as the robot is sent it; discretised for it where its document has no coefficients.
boost::asio::awaitable<Result<protocol::Controller>> controller_by_name(ControllerNames names, std::string name,
                                                                        station::RobotId robot_id) {
  storage::DesignFilter filter;
  filter.kind = storage::DesignKind::controller;
  filter.limit = static_cast<std::size_t>(kMaxLimit);
  const auto kept = co_await names.designs.list(filter);
  const auto found = std::ranges::find_if(kept, [&name](const storage::Design& one) { return one.made.name == name; });
  if (found == kept.end())
    co_return fail(ErrorCode::not_found, "the station keeps none of this name", "no_such_design");
  const station::RobotSettings* settings = names.station.settings(robot_id);
  const bool is_known = settings != nullptr && settings->is_controller_current && settings->controller;
  if (!is_known) co_return fail(ErrorCode::conflict, "the controller in force is not known", "not_known");
  const protocol::Controller in_force = *settings->controller;
  auto discretise = [document = found->made.document, in_force] {
    return analysis::sections_of(json::parse(document, nullptr, false), in_force.period_us / 1e6,
                                 in_force.duty_min >= 0);
  };
  const auto sections = co_await names.analysis.compute(std::move(discretise));
  if (!sections) co_return std::unexpected{sections.error()};
  const Members body{json{{"controller", *sections}}};
  const auto controller = controller_from(body, &in_force);
  if (!controller) co_return std::unexpected{controller.error()};
  // SAFETY: an experiment gives no controller more of the motor than the one in force has.
  const bool is_wider = controller->duty_min < in_force.duty_min || controller->duty_max > in_force.duty_max;
  if (is_wider) co_return fail(ErrorCode::forbidden, "its duty range is wider than that in force", "not_permitted");
  const auto noted = co_await names.designs.note_sent(found->id, robot_id, controller->checksum);
  if (!noted) co_return std::unexpected{noted.error()};
  co_return *controller;
}

}  // namespace

void connect_controllers(experiments::Experiments& experiments, ControllerNames names) {
  experiments.set_controller_by_name([names](std::string name, station::RobotId robot_id) {
    return controller_by_name(names, std::move(name), std::move(robot_id));
  });
}

void add_experiment_routes(http::Router& router, ExperimentRoutes parts) {
  const auto add = [&router, parts](const char* method, const std::string& pattern, identity::Scope needs,
                                    std::vector<std::string> query,
                                    http::Answer (*answer)(ExperimentRoutes, http::Request)) {
    router.add({method, pattern, needs, std::move(query), with(parts, answer)});
  };
  using identity::Scope;
  const std::string all = "/api/v1/experiments", one = all + "/{experiment_id}";
  add("POST", all, Scope::command, {}, begin_experiment);
  add("GET", all, Scope::read, {"robot_id", "state", "before", "limit"}, list_experiments);
  add("GET", one, Scope::read, {"wait_ms"}, get_experiment);
  add("GET", one + "/runs/{number}/prediction", Scope::read, {}, get_prediction);
  add("POST", one + "/keep-alive", Scope::command, {}, keep_alive);
  // SAFETY: everybody who may stop a robot may end, or pause, what moves it.
  add("POST", one + "/pause", Scope::stop, {}, pause_experiment);
  add("POST", one + "/abort", Scope::stop, {}, abort_experiment);
  add("POST", one + "/resume", Scope::command, {}, resume_experiment);
  add("POST", one + "/take-over", Scope::command, {}, take_over_experiment);
  add("POST", one + "/move", Scope::command, {}, move_experiment);
  add("GET", "/api/v1/experiment-profiles", Scope::read, {}, list_profiles);
  add("GET", "/api/v1/experiment-profiles/{profile}", Scope::read, {}, get_profile);
}

}  // namespace server::api
