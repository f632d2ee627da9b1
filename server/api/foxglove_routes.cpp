// Links and their tickets.
#include "server/api/foxglove_routes.hpp"

#include <fmt/format.h>

#include <map>

#include "server/api/bodies/json.hpp"

namespace server::api {
namespace {

http::Response is_off() {
  return http::problem(404,
                       "the Foxglove WebSocket is off; set enabled = true in the section [foxglove] of the station's "
                       "configuration and start it again",
                       "foxglove_off");
}

http::Response unknown_robot(const station::RobotId& robot) {
  return http::problem(404, fmt::format("no robot '{}' is known", robot.substr(0, 40)), "unknown_robot");
}

http::Answer make_link(FoxgloveRoutes parts, http::Request request) {
  if (!parts.is_enabled) co_return is_off();
  std::string query;
  if (!request.body.empty()) {
    const auto body = Members::parse(request.body, {"robot_id"});
    if (!body) co_return http::problem(body.error());
    if (body->has("robot_id")) {
      const auto robot = body->text("robot_id", {0, 200});
      if (!robot) co_return http::problem(robot.error());
      if (!is_robot_id(*robot)) {
        co_return http::problem(422, "robot_id is not 1 to 31 characters of [a-z0-9_-]", "out_of_range");
      }
      if (parts.clients.live.station.find(*robot) == nullptr) co_return unknown_robot(*robot);
      query = "robot=" + *robot + "&";
    }
  }
  const std::string host = request.header("host");
  const std::string ticket = parts.tickets.issue(request.caller);
  const std::string url = fmt::format("{}://{}/foxglove?{}ticket={}", parts.facts.is_secure() ? "wss" : "ws",
                                      host.empty() ? parts.facts.http_address : host, query, ticket);
  const std::int64_t ends_at_us = parts.clients.live.clock.utc_us() + identity::kTicketValidity.count();
  co_return http::json_response(201, {{"url", url}, {"expires_at_us", ends_at_us}});
}

// Answers a request that is no upgrade to WebSocket.
http::Answer without_upgrade(FoxgloveRoutes parts, http::Request) {
  if (!parts.is_enabled) co_return is_off();
  http::Response response = http::problem(426, "/foxglove speaks WebSocket only", "upgrade_required");
  response.headers.emplace_back("Upgrade", "websocket");
  co_return response;
}

// The ticket is used up last, so that a wrong request does not do it; who has none learns no robot's name.
std::expected<identity::Caller, http::Response> let_in(const FoxgloveRoutes& parts, const http::Request& request) {
  if (!parts.is_enabled) return std::unexpected{is_off()};
  if (foxglove_protocol(request.header("sec-websocket-protocol")).empty()) {
    return std::unexpected{http::problem(
        400, "the client does not offer the WebSocket sub-protocol foxglove.websocket.v1, nor foxglove.sdk.v1",
        "unknown_protocol")};
  }
  std::map<std::string, std::string> query;
  for (auto& [name, value] : request.target.query().value_or(http::Target::Query{})) query.emplace(name, value);
  const auto robot = query.find("robot");
  const bool has_ticket = parts.tickets.holds(query["ticket"]);
  if (has_ticket && robot != query.end() && parts.clients.live.station.find(robot->second) == nullptr) {
    return std::unexpected{unknown_robot(robot->second)};
  }
  auto caller = parts.tickets.redeem(query["ticket"]);
  if (caller) return std::move(*caller);
  return std::unexpected{http::problem(
      401, "the ticket of this link is missing, was used, or is too old: make a new link, which works once",
      "bad_ticket")};
}

}  // namespace

void add_foxglove_routes(http::Router& router, const FoxgloveRoutes& parts) {
  router.add({"GET", "/foxglove", identity::Scope::anyone, {"robot", "ticket"}, with(parts, without_upgrade)});
  router.add({"POST", "/api/v1/foxglove-links", identity::Scope::read, {}, with(parts, make_link)});
}

http::Upgrade foxglove_upgrade(const FoxgloveRoutes& parts) {
  return {[&clients = parts.clients](http::HttpStream stream, http::UpgradeRequest upgrade, identity::Caller caller) {
            return serve_foxglove(std::move(stream), std::move(upgrade), std::move(caller), clients);
          },
          [parts](const http::Request& request) { return let_in(parts, request); }};
}

}  // namespace server::api
