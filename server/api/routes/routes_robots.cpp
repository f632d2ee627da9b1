// Robots and their events.
#include <fmt/format.h>

#include <boost/asio/post.hpp>
#include <boost/asio/use_awaitable.hpp>

#include "server/api/bodies/json.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/api/routes/routes.hpp"
#include "server/live/robot_texts.hpp"
#include "server/station/station.hpp"
#include "server/storage/query/history.hpp"

namespace server::api {
namespace asio = boost::asio;
using nlohmann::json;

http::Response unknown_robot(const std::string& id) {
  return http::problem(404, fmt::format("no robot '{}' is known", id.substr(0, 40)), "unknown_robot");
}

namespace {

// All of a robot, or for a token that may stop and not read what its stop is about and nothing else.
json robot_json(const station::RobotState& robot, const identity::Caller& caller) {
  if (caller.scopes.allow(identity::Scope::read)) return api::to_json(robot);
  const station::SampleContext& context = robot.context;
  return {{"robot_id", robot.id},
          {"link", text(robot.link)},
          {"mode", protocol::text(context.mode)},
          {"emergency_id", live::id_text(context.emergency_id)},
          {"emergency_cause", protocol::text(context.emergency_cause)},
          {"pending_stop", live::id_text(robot.pending_stop.value_or(0))}};
}

// The same of all robots, some at a time: nobody else waits for it.
http::Answer list_robots_to_stop(RobotRoutes parts, http::Request request) {
  constexpr std::size_t kInATurn = 32;
  std::string text = R"({"robots":[)", last;
  for (bool more = true; more;) {
    auto robot = parts.station.robots().upper_bound(last);  // they may have changed since the last turn
    for (std::size_t count = 0; count < kInATurn && robot != parts.station.robots().end(); ++count, ++robot) {
      text += (last.empty() ? "" : ",") + base::dump(robot_json(robot->second, request.caller));
      last = robot->first;
    }
    more = robot != parts.station.robots().end();
    if (more) co_await asio::post(parts.loop, asio::use_awaitable);
  }
  co_return http::json_text_response(200, text + "]}");
}

// The robots that the first piece has no room for: each piece is made when the client has taken the one before.
class RobotList final : public http::BodyStream {
 public:
  RobotList(std::string first, live::RobotDocument document)
      : first_{std::move(first)}, document_{std::move(document)} {}

  asio::awaitable<Result<std::optional<std::string>>> next() override {
    if (!first_.empty()) co_return std::optional{std::exchange(first_, {})};
    if (document_.is_whole()) co_return std::optional<std::string>{};
    std::string piece = co_await document_.next();
    co_return std::optional{std::move(piece)};
  }

 private:
  std::string first_;
  live::RobotDocument document_;
};

http::Answer list_robots(RobotRoutes parts, http::Request request) {
  if (!request.caller.scopes.allow(identity::Scope::read))
    co_return co_await list_robots_to_stop(parts, std::move(request));
  live::RobotDocument document{parts.texts, R"({"robots":[)", "]}"};
  std::string first = co_await document.next();
  if (document.is_whole()) co_return http::json_text_response(200, std::move(first));
  http::Response response = http::json_text_response(200, "");
  response.stream = std::make_unique<RobotList>(std::move(first), std::move(document));
  co_return response;
}

http::Answer get_robot(RobotRoutes parts, http::Request request) {
  const std::string& id = request.param.at("robot_id");
  const station::RobotState* robot = parts.station.find(id);
  if (robot == nullptr) co_return unknown_robot(id);
  co_return http::json_response(200, robot_json(*robot, request.caller));
}

http::Answer list_events(RobotRoutes parts, http::Request request) {
  const std::string& id = request.param.at("robot_id");
  if (parts.station.find(id) == nullptr) co_return unknown_robot(id);
  const auto filter = query_record_filter(request);
  if (!filter) co_return http::problem(filter.error());
  const auto page = co_await parts.history.events(id, *filter);
  json body = list_json("events", page.records);
  body["next"] = page.next ? json(cursor_text(*page.next)) : json(nullptr);
  co_return http::json_response(200, body);
}

}  // namespace

void add_robot_routes(http::Router& router, RobotRoutes parts) {
  const auto add = [&router, parts](const char* pattern, identity::Scope needs, std::vector<std::string> query,
                                    http::Answer (*answer)(RobotRoutes, http::Request)) {
    router.add({"GET", pattern, needs, std::move(query), with(parts, answer)});
  };
  add("/api/v1/robots", identity::Scope::look, {}, list_robots);
  add("/api/v1/robots/{robot_id}", identity::Scope::look, {}, get_robot);
  add("/api/v1/robots/{robot_id}/events", identity::Scope::read, {"limit", "before", "from_us", "to_us"}, list_events);
}

}  // namespace server::api
