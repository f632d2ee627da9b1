// The fluids that robots may be in, with their limits and models, which one a robot is in, and a model of its own.
#include <algorithm>

#include "server/api/bodies/fluid_model_body.hpp"
#include "server/api/bodies/limits.hpp"
#include "server/api/routes/routes.hpp"
#include "server/config/station_document.hpp"
#include "server/identity/auth.hpp"
#include "server/station/station.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/runs/fluid_models.hpp"

namespace server::api {
using nlohmann::json;

namespace {

constexpr microseconds kSendingPatience{3'000'000};
constexpr microseconds kSendingLook{50'000};

json model_json(FluidRoutes parts, const std::string& fluid) {
  const station::FluidModel* model = parts.fluid_models.in_force().find(fluid);
  return model == nullptr ? json(nullptr) : to_json(*model);
}

http::Answer list_fluids(FluidRoutes parts, http::Request) {
  const config::Envelope& envelope = parts.station.envelope();
  json list = json::array();
  for (const auto& [fluid, limits] : envelope.of_fluid()) {
    const bool is_built_in =
        std::ranges::find(config::Envelope::kBuiltInFluids, fluid) != config::Envelope::kBuiltInFluids.end();
    list.push_back({{"fluid", fluid},
                    {"built_in", is_built_in},
                    {"limits", limits_json(limits)},
                    {"model", model_json(parts, fluid)}});
  }
  co_return http::json_response(200, {{"fluids", std::move(list)},
                                      {"limits", limits_json(envelope.anywhere())},
                                      {"limits_where_unknown", limits_json(envelope.strictest())}});
}

// null: not known.
Result<std::string> parse_fluid(const std::string& text, const config::Envelope& envelope) {
  const auto body = Members::parse(text, {"fluid"});
  if (!body) return std::unexpected{body.error()};
  if (body->has("fluid") && body->object().at("fluid").is_null()) return std::string{};
  const auto fluid = body->text("fluid", text_bytes("FluidBody.fluid"));
  if (!fluid) return fluid;
  return envelope.listed(*fluid);
}

// The state of the model on the robot, after it was sent or when the patience has ended.
boost::asio::awaitable<json> model_sent(FluidRoutes parts, std::string id) {
  const std::int64_t deadline_us = parts.clock.steady_us() + kSendingPatience.count();
  while (parts.station.find(id)->model.state == station::ModelState::sending && parts.clock.steady_us() < deadline_us) {
    co_await parts.clock.sleep_for(kSendingLook);
  }
  co_return to_json(parts.station.find(id)->model);
}

// Answered when it is on disk: a restart must not bring looser limits back.
http::Answer set_fluid(FluidRoutes parts, http::Request request) {
  const std::string& id = request.param.at("robot_id");
  const config::Envelope& envelope = parts.station.envelope();
  const auto fluid = parse_fluid(request.body, envelope);
  if (!fluid) co_return http::problem(fluid.error());
  const auto set = parts.station.set_fluid(id, *fluid, author_of(request, parts.clock));
  if (!set) co_return http::problem(set.error());
  const bool stored = co_await parts.recorder.flush_records();
  if (!stored) {
    co_return http::problem(503, "the fluid is in force and could not be stored yet; the station's log says why",
                            "not_stored");
  }
  json model = co_await model_sent(parts, id);
  co_return http::json_response(200, {{"fluid", fluid->empty() ? json(nullptr) : json(*fluid)},
                                      {"limits", limits_json(envelope.in(*fluid))},
                                      {"model", std::move(model)}});
}

// Nothing of it is kept: it ends with the robot's boot. SAFETY: why a model in grave doubt is confirmed stands in the
// audit before it is sent; who has lost the right meanwhile sends nothing.
http::Answer send_model(FluidRoutes parts, http::Request request) {
  const std::string& id = request.param.at("robot_id");
  auto body = parse_own_model(request.body);
  if (!body) co_return http::problem(body.error());
  const station::Author by = author_of(request, parts.clock);
  if (const auto may = parts.station.may_send_model(id, body->fluid, by); !may) co_return http::problem(may.error());
  const auto noted = co_await parts.fluid_models.note_sent(id, parts.station.find(id)->fluid, body->model, by);
  if (!noted) co_return http::problem(noted.error());
  if (auto stands = still_stands(request.caller); !stands) co_return http::problem(stands.error());
  const auto sent = parts.station.send_model(id, body->fluid, std::move(body->model), by);
  if (!sent) co_return http::problem(sent.error());
  json now = co_await model_sent(parts, id);
  co_return http::json_response(200, {{"model", std::move(now)}});
}

// The robots that are in this fluid: nothing is sent to them by itself.
json robots_in(const station::Station& station, const std::string& fluid) {
  json robots = json::array();
  for (const auto& [id, robot] : station.robots()) {
    if (robot.fluid == fluid) robots.push_back(id);
  }
  return robots;
}

http::Answer set_model(FluidRoutes parts, http::Request request) {
  auto model = parse_fluid_model(request.body);
  if (!model) co_return http::problem(model.error());
  const auto fluid = parts.station.envelope().listed(request.param.at("fluid"));
  if (!fluid) co_return http::problem(fluid.error());
  const auto set = co_await parts.fluid_models.set(*fluid, std::move(*model), author_of(request, parts.clock));
  if (!set) co_return http::problem(set.error());
  co_return http::json_response(
      200, {{"fluid", *fluid}, {"model", to_json(*set)}, {"robots_not_updated", robots_in(parts.station, *fluid)}});
}

http::Answer remove_model(FluidRoutes parts, http::Request request) {
  const auto fluid = parts.station.envelope().listed(request.param.at("fluid"));
  if (!fluid) co_return http::problem(fluid.error());
  const auto removed = co_await parts.fluid_models.remove(*fluid, author_of(request, parts.clock));
  if (!removed) co_return http::problem(removed.error());
  co_return http::json_response(
      200, {{"fluid", *fluid}, {"model", nullptr}, {"robots_not_updated", robots_in(parts.station, *fluid)}});
}

}  // namespace

void add_fluid_routes(http::Router& router, FluidRoutes parts) {
  const auto add = [&router, parts](const char* method, const char* pattern, identity::Scope needs,
                                    http::Answer (*answer)(FluidRoutes, http::Request)) {
    router.add({method, pattern, needs, {}, with(parts, answer)});
  };
  add("GET", "/api/v1/fluids", identity::Scope::read, list_fluids);
  add("POST", "/api/v1/fluids/{fluid}/model", identity::Scope::command, set_model);
  add("POST", "/api/v1/fluids/{fluid}/model/remove", identity::Scope::command, remove_model);
  add("POST", "/api/v1/robots/{robot_id}/fluid", identity::Scope::command, set_fluid);
  add("POST", "/api/v1/robots/{robot_id}/model", identity::Scope::command, send_model);
}

}  // namespace server::api
