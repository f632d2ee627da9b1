// The station itself, its documents, the login, and the cockpit's files.
#include <fmt/format.h>

#include "server/api/routes/assets.hpp"
#include "server/api/routes/routes.hpp"
#include "server/identity/auth.hpp"
#include "server/net/transport_security.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/upkeep/head_watch.hpp"

namespace server::api {
namespace {

http::Answer get_station(StationRoutes parts, http::Request) {
  const StationFacts& facts = parts.facts;
  co_return http::json_response(200,
                                {{"version", facts.version},
                                 {"store_id", std::to_string(facts.store_id)},
                                 {"utc_us", parts.clock.utc_us()},
                                 {"uptime_s", static_cast<double>(parts.clock.steady_us() - facts.started_at_us) / 1e6},
                                 {"http_address", facts.http_address},
                                 {"robots_address", facts.robots_address},
                                 {"security", facts.security->state()},
                                 {"losses", losses_json(parts.head_watch.losses())}});
}

http::Answer get_openapi(StationRoutes, http::Request request) {
  co_return asset_response(request, openapi_files().front());
}

// A link that lets one page in, as admin. Its address is the one that was asked, which RequestGuard knows to be ours.
http::Answer make_login_link(StationRoutes parts, http::Request request) {
  const std::string host = request.header("host");
  const std::string url =
      login_url(base_url(parts.facts, host.empty() ? parts.facts.http_address : host), parts.auth.new_login_code());
  station::AuditNote note;
  note.by = author_of(request, parts.clock);
  note.action = "account.link_made";
  note.can_flood = true;
  parts.recorder.on_audit(note);
  co_return http::json_response(
      201, {{"url", url}, {"expires_at_us", parts.clock.utc_us() + identity::kLoginCodeValidity.count()}});
}

// The code is redeemed by a press on the page alone, not by a picture, a preview or a prefetch of the link.
http::Answer show_login(StationRoutes, http::Request request) {
  request.path = "/";
  co_return page_response(request);
}

http::Answer live_without_upgrade(StationRoutes, http::Request) {
  http::Response response = http::problem(426, "/live speaks WebSocket only", "upgrade_required");
  response.headers.emplace_back("Upgrade", "websocket");
  co_return response;
}

}  // namespace

bool StationFacts::is_secure() const { return security->http().tls != nullptr; }

std::string base_url(const StationFacts& facts, const std::string& address) {
  return fmt::format("{}://{}", facts.is_secure() ? "https" : "http", address);
}

std::string login_url(const std::string& base_url, const std::string& code) {
  return fmt::format("{}/login?code={}", base_url, code);
}

void add_station_routes(http::Router& router, StationRoutes parts) {
  const auto add = [&router, parts](const char* pattern, identity::Scope needs, std::vector<std::string> query,
                                    http::Answer (*answer)(StationRoutes, http::Request)) {
    router.add({"GET", pattern, needs, std::move(query), with(parts, answer)});
  };
  add("/login", identity::Scope::anyone, {"code"}, show_login);
  add("/live", identity::Scope::read, {}, live_without_upgrade);
  add("/api/v1/station", identity::Scope::read, {}, get_station);
  add("/api/v1/openapi.yaml", identity::Scope::read, {}, get_openapi);
  router.add({"POST", "/api/v1/login-links", identity::Scope::admin, {}, with(parts, make_login_link)});
  router.set_fallback(page_response);
}

}  // namespace server::api
