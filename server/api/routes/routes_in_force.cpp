// What a robot says is in force: its parameters and its controller.
#include "base/json_text.hpp"
#include "server/api/routes/routes.hpp"
#include "server/live/state_json.hpp"
#include "server/station/station.hpp"
#include "server/storage/samples/in_force_json.hpp"

namespace server::api {
using nlohmann::json;

namespace {

std::unexpected<Error> robot_not_known(const std::string& id) {
  return fail(ErrorCode::not_found, fmt::format("no robot '{}' is known", id), "unknown_robot");
}

bool is_connected(const station::Station& station, const std::string& id) {
  const station::RobotState* robot = station.find(id);
  return robot != nullptr && robot->link == station::LinkState::connected;
}

json parameter_json(const rheonaut_Parameter& parameter) {
  return {{"name", parameter.name},
          {"unit", parameter.unit},
          {"value", base::decimal(parameter.value)},
          {"minimum", base::decimal(parameter.minimum)},
          {"maximum", base::decimal(parameter.maximum)},
          {"default", base::decimal(parameter.default_value)},
          {"changed", !station::is_same(parameter.value, parameter.default_value)},
          {"bounds_motion", station::bounds_motion(parameter.name)}};
}

http::Answer get_parameters(InForceRoutes parts, http::Request request) {
  const std::string& id = request.param.at("robot_id");
  const station::RobotSettings* known = parts.station.settings(id);
  if (known == nullptr) co_return http::problem(robot_not_known(id).error());
  json table;  // null: nothing is known, which is not the same as a robot without parameters
  for (const auto& [name, parameter] : known->parameters.last_known()) table.push_back(parameter_json(parameter));
  co_return http::json_response(200, {{"robot_id", id},
                                      {"is_current", is_connected(parts.station, id) && known->parameters.is_current()},
                                      {"told_at_us", live::time_or_null(known->parameters_at_us)},
                                      {"parameters", std::move(table)}});
}

}  // namespace

json controller_in_force(const station::Station& station, const std::string& id) {
  const station::RobotSettings* known = station.settings(id);
  if (known == nullptr) return nullptr;
  const json controller = known->controller ? storage::controller_json(*known->controller) : json(nullptr);
  return {{"robot_id", id},
          {"is_current", is_connected(station, id) && known->is_controller_current},
          {"told_at_us", live::time_or_null(known->controller_at_us)},
          {"controller", controller}};
}

namespace {

http::Answer get_controller(InForceRoutes parts, http::Request request) {
  const std::string& id = request.param.at("robot_id");
  const json known = controller_in_force(parts.station, id);
  if (known.is_null()) co_return http::problem(robot_not_known(id).error());
  co_return http::json_response(200, known);
}

}  // namespace

void add_in_force_routes(http::Router& router, InForceRoutes parts) {
  const auto add = [&router, parts](const char* pattern, http::Answer (*answer)(InForceRoutes, http::Request)) {
    router.add({"GET", pattern, identity::Scope::read, {}, with(parts, answer)});
  };
  add("/api/v1/robots/{robot_id}/parameters", get_parameters);
  add("/api/v1/robots/{robot_id}/controller", get_controller);
}

}  // namespace server::api
