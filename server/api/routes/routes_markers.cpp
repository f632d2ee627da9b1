// Markers: what somebody noted at a sample of a robot's recording.
#include <fmt/format.h>

#include "server/api/bodies/json.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/api/routes/routes.hpp"
#include "server/station/station.hpp"
#include "server/storage/runs/markers.hpp"

namespace server::api {
using nlohmann::json;

namespace {

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
  const auto after = query_number_cursor(request, "after", -1);
  if (!after) co_return http::problem(after.error());
  const auto limit = query_limit(request);
  if (!limit) co_return http::problem(limit.error());
  const auto markers = co_await parts.markers.of_robot(robot_id, *after, *limit + 1);
  const auto json_of = [](const storage::Marker& marker) { return to_json(marker); };
  const auto cursor_of = [](const storage::Marker& marker) { return marker.id; };
  co_return http::json_response(200, page_json("markers", markers, *limit, json_of, cursor_of));
}

http::Answer list_markers_of_run(MarkerRoutes parts, http::Request request) {
  const auto id = run_id_of(request);
  if (!id) co_return http::problem(id.error());
  const auto after = query_marker_cursor(request);
  if (!after) co_return http::problem(after.error());
  const auto limit = query_limit(request);
  if (!limit) co_return http::problem(limit.error());
  const auto page = co_await parts.markers.of_run(*id, *after, *limit);
  if (!page) co_return http::problem(page.error());
  json list = json::array();
  for (const storage::Marker& marker : page->markers) list.push_back(to_json(marker));
  const json next = page->next ? json(cursor_text(*page->next)) : json(nullptr);
  co_return http::json_response(200, {{"markers", std::move(list)}, {"next", next}});
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
  add("GET", "/api/v1/runs/{run_id}/markers", identity::Scope::read, {"after", "limit"}, list_markers_of_run);
}

}  // namespace server::api
