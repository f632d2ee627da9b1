// Robots, their commands, events and emergency stops.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "server/api/emergency.hpp"
#include "server/api/routes.hpp"

namespace server {
namespace asio = boost::asio;
using nlohmann::json;

namespace {

Response unknown_robot(const std::string& id) {
  return problem(404, fmt::format("no robot '{}' is known", id.substr(0, 40)), "unknown_robot");
}

Answer list_robots(ApiParts& parts, Request) {
  json list = json::array();
  for (const auto& [id, robot] : parts.station.robots()) list.push_back(to_json(robot));
  co_return json_response(200, {{"robots", std::move(list)}});
}

Answer get_robot(ApiParts& parts, Request request) {
  const std::string& id = request.param.at("robot_id");
  const RobotState* robot = parts.station.find(id);
  if (robot == nullptr) co_return unknown_robot(id);
  co_return json_response(200, to_json(*robot));
}

// What became of a command that was sent.
Response command_response(const CommandRecord& record) {
  const json with_command{{"command", to_json(record)}};
  switch (record.state) {
    case CommandState::acknowledged: return json_response(200, to_json(record));
    case CommandState::rejected:
      return problem(
          {ErrorCode::rejected, fmt::format("the robot refused {}: {}", record.kind, record.reason), record.reason},
          with_command);
    case CommandState::failed:
      return problem({ErrorCode::conflict, fmt::format("{} failed: {}", record.kind, record.reason), record.reason},
                     with_command);
    case CommandState::expired:
      return problem({ErrorCode::timed_out, fmt::format("{} expired before it took effect", record.kind),
                      record.reason.empty() ? "expired" : record.reason},
                     with_command);
    case CommandState::queued:
    case CommandState::sent: break;
  }
  return problem({ErrorCode::timed_out, fmt::format("the robot did not answer {} in time", record.kind), "timed_out"},
                 with_command);
}

Answer submit_command(ApiParts& parts, Request request) {
  const std::string& id = request.param.at("robot_id");
  if (parts.station.find(id) == nullptr) co_return unknown_robot(id);
  auto parsed = parse_command(request.body);
  if (!parsed) co_return problem(parsed.error());
  CommandRequest command{id, parsed->action, std::move(parsed->arguments), request.actor, parsed->life};
  const auto record = co_await parts.station.submit(std::move(command));
  if (!record) co_return problem(record.error());
  co_return command_response(*record);
}

// An acknowledged stop is in force and answered at once; one that is kept must outlive whatever happens after the
// answer, so it is on disk first.
int stop_status(const CommandRecord& record) { return record.state == CommandState::acknowledged ? 200 : 202; }

Answer emergency_stop(ApiParts& parts, Request request) {
  const auto record = co_await stop_robot(parts.station, request.param.at("robot_id"), request.actor);
  if (!record) co_return problem(record.error());
  const int status = stop_status(*record);
  if (status == 202) co_await parts.recording.history.settle();
  co_return json_response(status, to_json(*record));
}

Answer emergency_stop_all(ApiParts& parts, Request request) {
  const StopsOfAll stops = co_await stop_all_robots(parts.loop, parts.tasks, parts.station, request.actor);
  int status = 200;
  for (const CommandRecord& record : stops.records) status = std::max(status, stop_status(record));
  if (status == 202) co_await parts.recording.history.settle();
  json body = list_json("commands", stops.records);
  if (!stops.failed.empty()) {
    co_return problem(500, fmt::format("the stop of {} failed; the log says why", fmt::join(stops.failed, ", ")),
                      "internal", std::move(body));
  }
  co_return json_response(status, body);
}

Answer list_commands(ApiParts& parts, Request request) {
  const std::string& id = request.param.at("robot_id");
  if (parts.station.find(id) == nullptr) co_return unknown_robot(id);
  const auto limit = query_number(request, "limit", 1, kMaxLimit, kDefaultLimit);
  if (!limit) co_return problem(limit.error());
  const auto records = co_await parts.recording.history.commands(id, static_cast<std::size_t>(*limit));
  co_return json_response(200, list_json("commands", records));
}

Answer list_events(ApiParts& parts, Request request) {
  const std::string& id = request.param.at("robot_id");
  if (parts.station.find(id) == nullptr) co_return unknown_robot(id);
  const auto limit = query_number(request, "limit", 1, kMaxLimit, kDefaultLimit);
  if (!limit) co_return problem(limit.error());
  const auto events = co_await parts.recording.history.events(id, static_cast<std::size_t>(*limit));
  co_return json_response(200, list_json("events", events));
}

Answer get_command(ApiParts& parts, Request request) {
  const auto id = parse_id(request.param.at("command_id"));
  if (!id) co_return problem(400, "command_id is not a decimal number from 1", "out_of_range");
  const auto record = co_await parts.recording.history.command(*id);
  if (!record) co_return problem(record.error());
  co_return json_response(200, to_json(*record));
}

}  // namespace

void add_robot_routes(Router& router, ApiParts& parts) {
  const auto add = [&router, &parts](const char* method, const char* pattern, Scope needs,
                                     std::vector<std::string> query, Answer (*answer)(ApiParts&, Request)) {
    router.add({method, pattern, needs, std::move(query),
                [&parts, answer](Request request) { return answer(parts, std::move(request)); }});
  };
  add("GET", "/api/v1/robots", Scope::read, {}, list_robots);
  add("GET", "/api/v1/robots/{robot_id}", Scope::read, {}, get_robot);
  add("GET", "/api/v1/robots/{robot_id}/commands", Scope::read, {"limit"}, list_commands);
  add("POST", "/api/v1/robots/{robot_id}/commands", Scope::command, {}, submit_command);
  add("POST", "/api/v1/robots/{robot_id}/emergency-stop", Scope::stop, {}, emergency_stop);
  add("GET", "/api/v1/robots/{robot_id}/events", Scope::read, {"limit"}, list_events);
  add("GET", "/api/v1/commands/{command_id}", Scope::read, {}, get_command);
  add("POST", "/api/v1/emergency-stop", Scope::stop, {}, emergency_stop_all);
}

}  // namespace server
