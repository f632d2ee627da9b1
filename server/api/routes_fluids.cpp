// The fluids that robots may be in, with their limits, and which one a robot is in.
#include <algorithm>

#include "server/api/routes.hpp"
#include "server/station_document.hpp"

namespace server {
using nlohmann::json;

namespace {

constexpr std::size_t kMaxFluidBytes = 200;  // of what somebody sends; a listed name is shorter

Answer list_fluids(ApiParts& parts, Request) {
  const Envelope& envelope = parts.station.envelope();
  json list = json::array();
  for (const auto& [fluid, limits] : envelope.of_fluid()) {
    const bool is_built_in = std::ranges::find(Envelope::kBuiltInFluids, fluid) != Envelope::kBuiltInFluids.end();
    list.push_back({{"fluid", fluid}, {"built_in", is_built_in}, {"limits", limits_json(limits)}});
  }
  co_return json_response(200, {{"fluids", std::move(list)},
                                {"limits", limits_json(envelope.anywhere())},
                                {"limits_where_unknown", limits_json(envelope.strictest())}});
}

// null: not known.
Result<std::string> parse_fluid(const std::string& text, const Envelope& envelope) {
  const auto body = Members::parse(text, {"fluid"});
  if (!body) return std::unexpected{body.error()};
  if (body->has("fluid") && body->object().at("fluid").is_null()) return std::string{};
  const auto fluid = body->text("fluid", 1, kMaxFluidBytes);
  if (!fluid) return fluid;
  return envelope.listed(*fluid);
}

// Answered when it is on disk: a restart must not bring looser limits back.
Answer set_fluid(ApiParts& parts, Request request) {
  const std::string& id = request.param.at("robot_id");
  const Envelope& envelope = parts.station.envelope();
  const auto fluid = parse_fluid(request.body, envelope);
  if (!fluid) co_return problem(fluid.error());
  const auto set = parts.station.set_fluid(id, *fluid, author_of(request, parts.clock));
  if (!set) co_return problem(set.error());
  const bool stored = co_await parts.recording.recorder.flush_records();
  if (!stored) {
    co_return problem(503, "the fluid is in force and could not be stored yet; the station's log says why",
                      "not_stored");
  }
  co_return json_response(
      200, {{"fluid", fluid->empty() ? json(nullptr) : json(*fluid)}, {"limits", limits_json(envelope.in(*fluid))}});
}

}  // namespace

void add_fluid_routes(Router& router, ApiParts& parts) {
  const auto add = [&router, &parts](const char* method, const char* pattern, Scope needs,
                                     Answer (*answer)(ApiParts&, Request)) {
    router.add(
        {method, pattern, needs, {}, [&parts, answer](Request request) { return answer(parts, std::move(request)); }});
  };
  add("GET", "/api/v1/fluids", Scope::read, list_fluids);
  add("POST", "/api/v1/robots/{robot_id}/fluid", Scope::command, set_fluid);
}

}  // namespace server
