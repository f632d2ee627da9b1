// A controller that is kept goes to a robot: noted for the runs that are made with it, sent as set_controller, read
// back, compared.
#include <fmt/format.h>

#include "base/json_text.hpp"
#include "server/analysis/analysis_service.hpp"
#include "server/analysis/tuning/controller_document.hpp"
#include "server/api/analysis/analysis_routes.hpp"
#include "server/api/bodies/controller_body.hpp"
#include "server/api/bodies/json.hpp"
#include "server/api/bodies/limits.hpp"
#include "server/station/station.hpp"
#include "server/storage/designs/designs.hpp"

namespace server::api {
using nlohmann::json;

namespace {

constexpr double kUsPerS = 1e6;
constexpr double kDefaultPeriod_s = 0.01;
constexpr int kDefaultLife_ms = 10'000;  // the longest that a command may have: it pays for the discretisation

// What a document without coefficients is discretised for.
struct Robot {
  double period_s = kDefaultPeriod_s;
  bool is_one_way = false;
};

Robot robot_of(const station::RobotSettings* known, const json& body) {
  Robot robot;
  double duty_min = -1;
  if (known != nullptr && known->is_controller_current && known->controller) {
    robot.period_s = known->controller->period_us / kUsPerS;
    duty_min = static_cast<double>(known->controller->duty_min);
  }
  const auto asked = body.find("duty_min");
  if (asked != body.end() && asked->is_number()) duty_min = asked->get<double>();
  robot.is_one_way = duty_min >= 0;
  return robot;
}

// The command for the same robot, by the same caller, with the same age and key.
http::Request command_request(http::Request request, json body, json controller) {
  body.erase("design_id");
  body["kind"] = "set_controller";
  body["controller"] = std::move(controller);
  if (!body.contains("life_ms")) body["life_ms"] = kDefaultLife_ms;
  request.body = base::dump(body);
  request.query["wait"] = "verified";
  return request;
}

// As the command will send it; none: the command is refused, with the reason.
std::optional<std::uint32_t> checksum_in(const std::string& command, const station::RobotSettings* known) {
  const bool is_current = known != nullptr && known->is_controller_current && known->controller;
  const auto controller =
      controller_from(Members{json::parse(command, nullptr, false)}, is_current ? &*known->controller : nullptr);
  return controller ? std::optional{controller->checksum} : std::nullopt;
}

http::Answer push_controller(PushRoutes parts, http::Request request) {
  const auto body = Members::parse(request.body, {"design_id", "duty_min", "duty_max", "derivative_on", "confirm",
                                                  "life_ms", "stamp_us", "issued_at_us"});
  if (!body) co_return http::problem(body.error());
  const auto id = body->integer("design_id", integers("PushControllerBody.design_id"));
  if (!id) co_return http::problem(id.error());
  const auto design = co_await parts.designs.find(*id);
  if (!design) co_return http::problem(design.error());
  if (design->made.kind != storage::DesignKind::controller) {
    co_return http::problem(422, fmt::format("design {} is a model; a robot takes controllers", *id), "other_kind");
  }
  const std::string robot_id = request.param.at("robot_id");
  const Robot robot = robot_of(parts.commands.station.settings(robot_id), body->object());
  auto discretise = [document = design->made.document, robot] {
    return analysis::sections_of(json::parse(document, nullptr, false), robot.period_s, robot.is_one_way);
  };
  auto controller = co_await parts.analysis.compute(std::move(discretise));
  if (!controller) {
    co_return http::problem(422, fmt::format("design {}: {}", *id, controller.error().detail), "no_controller");
  }
  http::Request command = command_request(std::move(request), body->object(), std::move(*controller));
  const bool is_known = parts.commands.station.find(robot_id) != nullptr;
  const auto checksum = is_known ? checksum_in(command.body, parts.commands.station.settings(robot_id)) : std::nullopt;
  if (checksum) {
    const auto noted = co_await parts.designs.note_sent(*id, robot_id, *checksum);
    if (!noted) co_return http::problem(noted.error());
  }
  http::Response answered = co_await submit_command(parts.commands, std::move(command));
  if (answered.status != 200) co_return answered;
  const json record = json::parse(answered.body, nullptr, false);
  co_return http::json_response(
      200, {{"design_id", *id},
            {"plant_doubts_text", analysis::doubts_about_model(json::parse(design->made.document, nullptr, false))},
            {"verified", record.at("state") == "verified"},
            {"command", record},
            {"in_force", controller_in_force(parts.commands.station, robot_id)}});
}

}  // namespace

void add_push_routes(http::Router& router, PushRoutes parts) {
  router.add(
      {"POST", "/api/v1/robots/{robot_id}/controller", identity::Scope::command, {}, with(parts, push_controller)});
}

}  // namespace server::api
