// Markers: what somebody noted at a sample of a robot's recording.
#include <fmt/format.h>

#include "server/api/bodies/json.hpp"
#include "server/api/bodies/limits.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/api/routes/routes.hpp"
#include "server/station/station.hpp"
#include "server/storage/runs/markers.hpp"

namespace server::api {
using nlohmann::json;

namespace {

constexpr std::int64_t kMaxMarkerId = kMaxJavaScriptInteger;

json to_json(const storage::Marker& marker) {
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

json markers_json(const std::vector<storage::Marker>& markers) {
  json list = json::array();
  for (const storage::Marker& marker : markers) list.push_back(to_json(marker));
  return {{"markers", std::move(list)}};
}

http::Response no_such_robot(const std::string& robot_id) {
  return http::problem(404, fmt::format("no robot '{}' is known", robot_id), "unknown_robot");
}

http::Answer add_marker(MarkerRoutes parts, http::Request request) {
  const std::string robot_id = request.param.at("robot_id");
  auto body = parse_marker(request.body);
  if (!body) co_return http::problem(body.error());
  const station::RobotState* robot = parts.station.find(robot_id);
  if (robot == nullptr) co_return no_such_robot(robot_id);
  storage::MarkerRequest marker_request{robot_id, std::move(body->text), request.actor, body->at_us,
                                        robot->link == station::LinkState::connected ? robot->boot_id : 0};
  const auto marker = co_await parts.markers.add(std::move(marker_request));
  if (!marker) co_return http::problem(marker.error());
  co_return http::json_response(201, to_json(*marker));
}

http::Answer list_markers(MarkerRoutes parts, http::Request request) {
  const std::string robot_id = request.param.at("robot_id");
  if (parts.station.find(robot_id) == nullptr) co_return no_such_robot(robot_id);
  const auto after = query_number(request, "after", 1, kMaxMarkerId, 0);
  if (!after) co_return http::problem(after.error());
  const auto limit = query_number(request, "limit", 1, kMaxLimit, kDefaultLimit);
  if (!limit) co_return http::problem(limit.error());
  const auto markers = co_await parts.markers.of_robot(robot_id, *after, static_cast<std::size_t>(*limit));
  co_return http::json_response(200, markers_json(markers));
}

http::Answer list_markers_of_run(MarkerRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto markers = co_await parts.markers.of_run(*id);
  if (!markers) co_return http::problem(markers.error());
  co_return http::json_response(200, markers_json(*markers));
}

}  // namespace

void add_marker_routes(http::Router& router, MarkerRoutes parts) {
  const auto add = [&router, parts](const char* method, const char* pattern, identity::Scope needs,
                                    std::vector<std::string> query,
                                    http::Answer (*answer)(MarkerRoutes, http::Request)) {
    router.add({method, pattern, needs, std::move(query), with(parts, answer)});
  };
  add("POST", "/api/v1/robots/{robot_id}/markers", identity::Scope::record, {}, add_marker);
  add("GET", "/api/v1/robots/{robot_id}/markers", identity::Scope::read, {"after", "limit"}, list_markers);
  add("GET", "/api/v1/runs/{run_id}/markers", identity::Scope::read, {}, list_markers_of_run);
}

}  // namespace server::api
