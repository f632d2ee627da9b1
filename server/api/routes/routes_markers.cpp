// Markers: what somebody noted at a sample of a robot's recording.
#include <fmt/format.h>

#include "server/api/bodies/json.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/api/routes/routes.hpp"
#include "server/station/station.hpp"
#include "server/storage/runs/markers.hpp"

namespace server {
using nlohmann::json;

namespace {

constexpr std::int64_t kMaxMarkerId = 9'007'199'254'740'991;  // the largest integer that JavaScript holds

json to_json(const Marker& marker) {
  json out;
  out["marker_id"] = marker.id;
  out["boot_id"] = std::to_string(marker.boot_id);
  out["seq"] = marker.seq;
  out["robot_time_us"] = marker.robot_time_us ? json(*marker.robot_time_us) : json(nullptr);
  out["utc_us"] = marker.utc_us ? json(*marker.utc_us) : json(nullptr);
  out["text"] = marker.text;
  out["actor"] = marker.actor;
  out["made_at_us"] = marker.made_at_us;
  return out;
}

json markers_json(const std::vector<Marker>& markers) {
  json list = json::array();
  for (const Marker& marker : markers) list.push_back(to_json(marker));
  return {{"markers", std::move(list)}};
}

Response no_such_robot(const std::string& robot_id) {
  return problem(404, fmt::format("no robot '{}' is known", robot_id), "unknown_robot");
}

Answer add_marker(MarkerRoutes parts, Request request) {
  const std::string robot_id = request.param.at("robot_id");
  auto body = parse_marker(request.body);
  if (!body) co_return problem(body.error());
  const RobotState* robot = parts.station.find(robot_id);
  if (robot == nullptr) co_return no_such_robot(robot_id);
  MarkerRequest marker_request{robot_id, std::move(body->text), request.actor, body->at_us,
                               robot->link == LinkState::connected ? robot->boot_id : 0};
  const auto marker = co_await parts.markers.add(std::move(marker_request));
  if (!marker) co_return problem(marker.error());
  co_return json_response(201, to_json(*marker));
}

Answer list_markers(MarkerRoutes parts, Request request) {
  const std::string robot_id = request.param.at("robot_id");
  if (parts.station.find(robot_id) == nullptr) co_return no_such_robot(robot_id);
  const auto after = query_number(request, "after", 1, kMaxMarkerId, 0);
  if (!after) co_return problem(after.error());
  const auto limit = query_number(request, "limit", 1, kMaxLimit, kDefaultLimit);
  if (!limit) co_return problem(limit.error());
  const auto markers = co_await parts.markers.of_robot(robot_id, *after, static_cast<std::size_t>(*limit));
  co_return json_response(200, markers_json(markers));
}

Answer list_markers_of_run(MarkerRoutes parts, Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return problem(id.error());
  const auto markers = co_await parts.markers.of_run(*id);
  if (!markers) co_return problem(markers.error());
  co_return json_response(200, markers_json(*markers));
}

}  // namespace

void add_marker_routes(Router& router, MarkerRoutes parts) {
  const auto add = [&router, parts](const char* method, const char* pattern, Scope needs,
                                    std::vector<std::string> query, Answer (*answer)(MarkerRoutes, Request)) {
    router.add({method, pattern, needs, std::move(query), with(parts, answer)});
  };
  add("POST", "/api/v1/robots/{robot_id}/markers", Scope::record, {}, add_marker);
  add("GET", "/api/v1/robots/{robot_id}/markers", Scope::read, {"after", "limit"}, list_markers);
  add("GET", "/api/v1/runs/{run_id}/markers", Scope::read, {}, list_markers_of_run);
}

}  // namespace server
