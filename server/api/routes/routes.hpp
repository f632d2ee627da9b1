// All routes of the API, grouped by noun: routes_station, routes_recording, routes_robots, routes_commands,
// routes_in_force, routes_fluids, routes_runs, routes_markers, routes_references, routes_samples, routes_overview,
// routes_exports, routes_accounts, routes_audit.
//
// Held to openapi.yaml both ways by a test. Each answer is a coroutine that can be called without a server.
#pragma once

#include <cstdint>
#include <string>

#include "server/analysis/analysis_service.hpp"
#include "server/api/bodies/json.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/http/router.hpp"
#include "server/identity/auth.hpp"
#include "server/identity/logins.hpp"
#include "server/live/live_feed.hpp"
#include "server/live/robot_texts.hpp"
#include "server/net/transport_security.hpp"
#include "server/runtime/tasks.hpp"
#include "server/station/station.hpp"
#include "server/storage/recording_parts.hpp"

namespace server {

struct StationFacts {
  std::string version;
  std::uint64_t store_id = 0;
  std::string http_address;
  std::string robots_address;
  std::int64_t started_at_us = 0;         // steady
  TransportSecurity* security = nullptr;  // never null
  bool is_secure() const { return security->http().tls != nullptr; }
};

// What the routes work with; everything outlives the router.
struct ApiParts {
  boost::asio::io_context& loop;
  TaskGroup& tasks;
  Clock& clock;
  Station& station;
  LiveFeed& live;
  RobotTexts& texts;
  RecordingParts& recording;
  AnalysisService& analysis;
  Auth& auth;
  Accounts& accounts;
  Logins& logins;
  StationFacts facts;
};

void add_station_routes(Router& router, ApiParts& parts);
void add_recording_routes(Router& router, ApiParts& parts);
void add_robot_routes(Router& router, ApiParts& parts);
void add_command_routes(Router& router, ApiParts& parts);
void add_in_force_routes(Router& router, ApiParts& parts);
void add_fluid_routes(Router& router, ApiParts& parts);
void add_run_routes(Router& router, ApiParts& parts);
void add_marker_routes(Router& router, ApiParts& parts);
void add_reference_routes(Router& router, ApiParts& parts);
void add_sample_routes(Router& router, ApiParts& parts);
void add_overview_routes(Router& router, ApiParts& parts);
void add_export_routes(Router& router, ApiParts& parts);
void add_account_routes(Router& router, ApiParts& parts);
void add_audit_routes(Router& router, ApiParts& parts);

// Everything above, and the cockpit as fallback.
void add_routes(Router& router, ApiParts& parts);

std::string base_url(const StationFacts& facts, const std::string& address);  // "https://127.0.0.1:8080"
std::string login_url(const std::string& base_url, const std::string& code);
nlohmann::json to_json(const OutsideReference& reference);
nlohmann::json losses_json(const std::vector<StoreLoss>& losses);

// Who asks, and now.
inline Author author_of(const Request& request, const Clock& clock) {
  return {request.actor, request.peer, clock.utc_us()};
}

inline constexpr std::int64_t kDefaultLimit = 100;
inline constexpr std::int64_t kMaxLimit = 1000;

}  // namespace server
