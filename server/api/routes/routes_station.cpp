// The station itself, its documents, the login, and the cockpit's files.
#include <fmt/format.h>

#include "server/api/routes/assets.hpp"
#include "server/api/routes/routes.hpp"

namespace server {
namespace {

Answer get_station(ApiParts& parts, Request) {
  const StationFacts& facts = parts.facts;
  co_return json_response(200, {{"version", facts.version},
                                {"store_id", std::to_string(facts.store_id)},
                                {"utc_us", parts.clock.utc_us()},
                                {"uptime_s", static_cast<double>(parts.clock.steady_us() - facts.started_at_us) / 1e6},
                                {"http_address", facts.http_address},
                                {"robots_address", facts.robots_address},
                                {"security", facts.security->state()},
                                {"losses", losses_json(parts.recording.head_watch.losses())}});
}

Answer get_openapi(ApiParts&, Request request) { co_return asset_response(request, openapi_document()); }

// A link that lets one page in, as admin. Its address is the one that was asked, which RequestGuard knows to be ours.
Answer make_login_link(ApiParts& parts, Request request) {
  const std::string host = request.header("host");
  const std::string url =
      login_url(base_url(parts.facts, host.empty() ? parts.facts.http_address : host), parts.auth.new_login_code());
  AuditNote note;
  note.by = author_of(request, parts.clock);
  note.action = "account.link_made";
  note.can_flood = true;
  parts.recording.recorder.on_audit(note);
  co_return json_response(201, {{"url", url}, {"expires_at_us", parts.clock.utc_us() + kLoginCodeLife.count()}});
}

Answer log_in(ApiParts& parts, Request request) {
  if (request.method == "HEAD") {  // whoever only looks, as previews of links do, does not use the code up
    Response response = problem(405, "HEAD is not possible here", "method_not_allowed");
    response.headers.emplace_back("Allow", "GET");
    co_return response;
  }
  const auto session = parts.auth.log_in(request.query["code"], request.peer, request.header("user-agent"));
  if (!session) {
    co_return html_response(
        401,
        "<!doctype html><title>Rheonaut</title><p>This link was used already or is too old. Open "
        "the link that the station prints when it starts, or make a new one: docs/api.md says how.");
  }
  Response response = html_response(303, "");
  response.headers.emplace_back("Location", "/");
  response.headers.emplace_back("Set-Cookie", parts.auth.cookie(*session, parts.facts.is_secure()));
  co_return response;
}

Answer live_without_upgrade(ApiParts&, Request) {
  Response response = problem(426, "/live speaks WebSocket only", "upgrade_required");
  response.headers.emplace_back("Upgrade", "websocket");
  co_return response;
}

}  // namespace

std::string base_url(const StationFacts& facts, const std::string& address) {
  return fmt::format("{}://{}", facts.is_secure() ? "https" : "http", address);
}

std::string login_url(const std::string& base_url, const std::string& code) {
  return fmt::format("{}/login?code={}", base_url, code);
}

void add_station_routes(Router& router, ApiParts& parts) {
  const auto add = [&router, &parts](const char* pattern, Scope needs, std::vector<std::string> query,
                                     Answer (*answer)(ApiParts&, Request)) {
    router.add({"GET", pattern, needs, std::move(query),
                [&parts, answer](Request request) { return answer(parts, std::move(request)); }});
  };
  add("/login", Scope::anyone, {"code"}, log_in);
  add("/live", Scope::read, {}, live_without_upgrade);
  add("/api/v1/station", Scope::read, {}, get_station);
  add("/api/v1/openapi.yaml", Scope::read, {}, get_openapi);
  router.add({"POST", "/api/v1/login-links", Scope::admin, {}, [&parts](Request request) {
                return make_login_link(parts, std::move(request));
              }});
  router.set_fallback(page_response);
}

void add_routes(Router& router, ApiParts& parts) {
  add_station_routes(router, parts);
  add_recording_routes(router, parts);
  add_robot_routes(router, parts);
  add_command_routes(router, parts);
  add_in_force_routes(router, parts);
  add_fluid_routes(router, parts);
  add_run_routes(router, parts);
  add_marker_routes(router, parts);
  add_reference_routes(router, parts);
  add_sample_routes(router, parts);
  add_overview_routes(router, parts);
  add_export_routes(router, parts);
  add_account_routes(router, parts);
  add_audit_routes(router, parts);
}

}  // namespace server
