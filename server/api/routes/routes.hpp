// All routes of the API, grouped by noun: routes_station, routes_recording, routes_robots, routes_commands,
// routes_in_force, routes_fluids, routes_runs, routes_markers, routes_references, routes_samples, routes_overview,
// routes_exports, routes_accounts, routes_audit.
//
// Held to openapi.yaml both ways by a test. Each answer is a coroutine that can be called without a server.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "server/http/router.hpp"
#include "server/runtime/clock.hpp"
#include "server/station/state/audit_note.hpp"

namespace boost::asio {
class io_context;
}

namespace server {

class Accounts;
class AnalysisService;
class Auth;
class RunDigester;
class DiskWatch;
class ExceptionLog;
class FluidModels;
class HeadWatch;
class History;
class LiveFeed;
class Logins;
class Markers;
class OutsideReferences;
class Recorder;
class RobotTexts;
class Runs;
class Station;
class TaskGroup;
class TransportSecurity;
struct OutsideReference;
struct RecordingParts;
struct StoreLoss;

struct StationFacts {
  std::string version;
  std::uint64_t store_id = 0;
  std::string http_address;
  std::string robots_address;
  std::int64_t started_at_us = 0;         // steady
  TransportSecurity* security = nullptr;  // never null
  bool is_secure() const;
};

// The routes of each noun, with what they work with; all of it outlives the router.

struct AccountRoutes {
  Accounts& accounts;
  Auth& auth;
  Logins& logins;
  Clock& clock;
  Station& station;
  const StationFacts& facts;
};
void add_account_routes(Router& router, AccountRoutes parts);

struct AuditRoutes {
  Clock& clock;
  History& history;
  Recorder& recorder;
};
void add_audit_routes(Router& router, AuditRoutes parts);

struct CommandRoutes {
  Clock& clock;
  History& history;
  Station& station;
};
void add_command_routes(Router& router, CommandRoutes parts);

struct ExportRoutes {
  TaskGroup& tasks;
  History& history;  // on a worker of its own
  DiskWatch& disk_watch;
  std::filesystem::path database;
  std::filesystem::path folder;  // of files on their way
};
void add_export_routes(Router& router, ExportRoutes parts);

struct FluidRoutes {
  Clock& clock;
  FluidModels& fluid_models;
  Recorder& recorder;
  Station& station;
};
void add_fluid_routes(Router& router, FluidRoutes parts);

struct InForceRoutes {
  Station& station;
};
void add_in_force_routes(Router& router, InForceRoutes parts);

struct MarkerRoutes {
  Markers& markers;
  Station& station;
};
void add_marker_routes(Router& router, MarkerRoutes parts);

struct OverviewRoutes {
  History& history;
};
void add_overview_routes(Router& router, OverviewRoutes parts);

struct RecordingRoutes {
  Clock& clock;
  RecordingParts& recording;
  Station& station;
  TransportSecurity& security;
  ExceptionLog& exceptions;
};
void add_recording_routes(Router& router, RecordingRoutes parts);

struct ReferenceRoutes {
  AnalysisService& analysis;
  Clock& clock;
  OutsideReferences& references;
};
void add_reference_routes(Router& router, ReferenceRoutes parts);

struct RobotRoutes {
  boost::asio::io_context& loop;
  History& history;
  Station& station;
  RobotTexts& texts;
};
void add_robot_routes(Router& router, RobotRoutes parts);

struct RunRoutes {
  AnalysisService& analysis;
  RunDigester& digester;
  Clock& clock;
  DiskWatch& disk_watch;
  LiveFeed& live;
  Runs& runs;
  Station& station;
};
void add_run_routes(Router& router, RunRoutes parts);

struct SampleRoutes {
  History& history;
};
void add_sample_routes(Router& router, SampleRoutes parts);

struct StationRoutes {
  Auth& auth;
  Clock& clock;
  HeadWatch& head_watch;
  Recorder& recorder;
  const StationFacts& facts;
};
void add_station_routes(Router& router, StationRoutes parts);

// An answer that gets its parts by value: they are references, and a coroutine keeps its own copy of them.
template <class Parts>
std::function<Answer(Request)> with(Parts parts, Answer (*answer)(Parts, Request)) {
  return [parts, answer](Request request) { return answer(parts, std::move(request)); };
}

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

Response unknown_robot(const std::string& id);  // 404, whatever was asked of it

}  // namespace server
