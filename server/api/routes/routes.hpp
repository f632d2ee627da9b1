// All routes of the API, grouped by noun: routes_station, routes_recording, routes_robots, routes_commands,
// routes_health, routes_in_force, routes_fluids, routes_runs, routes_markers, routes_references, routes_reservations,
// routes_samples, routes_overview, routes_exports, routes_accounts, routes_audit; and those of server/api/analysis.
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

namespace server::analysis {
class AnalysisService;
}  // namespace server::analysis

namespace server::identity {
class Accounts;
class Auth;
class Logins;
}  // namespace server::identity

namespace server::live {
class LiveFeed;
class RobotTexts;
}  // namespace server::live

namespace server::net {
class TransportSecurity;
}  // namespace server::net

namespace server::runtime {
class ExceptionLog;
class LoopLateness;
class TaskGroup;
}  // namespace server::runtime

namespace server::station {
class Station;
}  // namespace server::station

namespace server::storage {
class DiskWatch;
class FluidModels;
class HeadWatch;
class History;
class Markers;
class OutsideReferences;
class Recorder;
class ReservationBook;
class RunDigester;
class RunFinalizer;
class Runs;
struct ExportSlots;
struct OutsideReference;
struct RecordingParts;
struct StoreLoss;
}  // namespace server::storage

namespace server::api {

struct StationFacts {
  std::string version;
  std::uint64_t store_id = 0;
  std::string http_address;
  std::string robots_address;
  std::int64_t started_at_us = 0;              // steady
  net::TransportSecurity* security = nullptr;  // never null
  bool is_secure() const;
};

// The routes of each noun, with what they work with; all of it outlives the router.

struct AccountRoutes {
  identity::Accounts& accounts;
  identity::Auth& auth;
  identity::Logins& logins;
  storage::RunFinalizer& finalizer;
  runtime::Clock& clock;
  station::Station& station;
  const StationFacts& facts;
};
void add_account_routes(http::Router& router, AccountRoutes parts);

struct AuditRoutes {
  runtime::Clock& clock;
  storage::History& history;
  storage::Recorder& recorder;
};
void add_audit_routes(http::Router& router, AuditRoutes parts);

struct CommandRoutes {
  runtime::Clock& clock;
  storage::History& history;
  station::Station& station;
};
void add_command_routes(http::Router& router, CommandRoutes parts);
// The answer of POST …/commands, for routes that make the command's body themselves.
http::Answer submit_command(CommandRoutes parts, http::Request request);

struct ExportRoutes {
  runtime::TaskGroup& tasks;
  storage::History& history;  // on a worker of its own
  storage::DiskWatch& disk_watch;
  storage::ExportSlots& slots;
  std::filesystem::path database;
  std::filesystem::path folder;  // of files on their way
};
void add_export_routes(http::Router& router, ExportRoutes parts);

struct FluidRoutes {
  runtime::Clock& clock;
  storage::FluidModels& fluid_models;
  storage::Recorder& recorder;
  station::Station& station;
};
void add_fluid_routes(http::Router& router, FluidRoutes parts);

struct InForceRoutes {
  station::Station& station;
};
void add_in_force_routes(http::Router& router, InForceRoutes parts);
// What GET …/controller answers; null for a robot that is not known.
nlohmann::json controller_in_force(const station::Station& station, const std::string& robot_id);

struct MarkerRoutes {
  storage::Markers& markers;
  station::Station& station;
};
void add_marker_routes(http::Router& router, MarkerRoutes parts);

struct OverviewRoutes {
  storage::History& history;
};
void add_overview_routes(http::Router& router, OverviewRoutes parts);

struct RecordingRoutes {
  runtime::Clock& clock;
  storage::RecordingParts& recording;
  station::Station& station;
  net::TransportSecurity& security;
  runtime::ExceptionLog& exceptions;
  const runtime::LoopLateness& lateness;
};
void add_recording_routes(http::Router& router, RecordingRoutes parts);
void add_health_routes(http::Router& router, RecordingRoutes parts);

struct ReferenceRoutes {
  analysis::AnalysisService& analysis;
  runtime::Clock& clock;
  storage::OutsideReferences& references;
};
void add_reference_routes(http::Router& router, ReferenceRoutes parts);

struct ReservationRoutes {
  identity::Accounts& accounts;
  runtime::Clock& clock;
  storage::ReservationBook& reservations;
  station::Station& station;
};
void add_reservation_routes(http::Router& router, ReservationRoutes parts);

struct RobotRoutes {
  boost::asio::io_context& loop;
  storage::History& history;
  station::Station& station;
  live::RobotTexts& texts;
};
void add_robot_routes(http::Router& router, RobotRoutes parts);

struct RunRoutes {
  analysis::AnalysisService& analysis;
  storage::RunDigester& digester;
  storage::RunFinalizer& finalizer;
  runtime::Clock& clock;
  storage::DiskWatch& disk_watch;
  live::LiveFeed& live;
  storage::Runs& runs;
  station::Station& station;
};
void add_run_routes(http::Router& router, RunRoutes parts);

struct SampleRoutes {
  storage::History& history;
};
void add_sample_routes(http::Router& router, SampleRoutes parts);

struct StationRoutes {
  identity::Auth& auth;
  runtime::Clock& clock;
  storage::HeadWatch& head_watch;
  storage::Recorder& recorder;
  const StationFacts& facts;
};
void add_station_routes(http::Router& router, StationRoutes parts);

// An answer that gets its parts by value: they are references, and a coroutine keeps its own copy of them.
template <class Parts>
std::function<http::Answer(http::Request)> with(Parts parts, http::Answer (*answer)(Parts, http::Request)) {
  return [parts, answer](http::Request request) { return answer(parts, std::move(request)); };
}

std::string base_url(const StationFacts& facts, const std::string& address);  // "https://127.0.0.1:8080"
std::string login_url(const std::string& base_url, const std::string& code);
nlohmann::json losses_json(const std::vector<storage::StoreLoss>& losses);

// Who asks, and now.
inline station::Author author_of(const http::Request& request, const runtime::Clock& clock) {
  return {request.actor, request.peer, clock.utc_us(), request.caller.client};
}

http::Response unknown_robot(const std::string& id);  // 404, whatever was asked of it

}  // namespace server::api
