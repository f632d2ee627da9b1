// Whether the station is alive and ready, for a supervisor; without a token, so nothing secret is in it.
#include "server/api/routes/routes.hpp"
#include "server/net/transport_security.hpp"
#include "server/storage/recording_parts.hpp"

namespace server::api {
using nlohmann::json;

namespace {

// Who is not ready, and where the details are for those who have a token.
json problems(const RecordingRoutes& parts) {
  json list = json::array();
  const auto add = [&list](const char* reason, const char* detail) {
    list.push_back({{"reason", reason}, {"detail", detail}});
  };
  const storage::RecordingParts& recording = parts.recording;
  if (recording.recorder.failing()) {
    add("recording_failing", "nothing becomes durable now; the log and GET /api/v1/recording say why");
  }
  if (!recording.recorder.failing() && !recording.disk_watch.use().is_writable) {
    add("database_read_only", "the database's file is not there, or cannot be written: look at the data folder");
  }
  if (recording.disk_watch.state() == storage::SpaceState::critical) {
    add("low_space", "the disk has less room than recording.critical_space_mb: make room");
  }
  if (parts.security.http().listening == 0 || parts.security.robots().listening == 0) {
    add("not_listening", "a port accepts no connections: the station starts, or stops");
  }
  return list;
}

// The loop answers: that is all that it says.
http::Answer get_healthz(RecordingRoutes, http::Request) { co_return http::json_response(200, {{"alive", true}}); }

http::Answer get_readyz(RecordingRoutes parts, http::Request) {
  const json list = problems(parts);
  co_return http::json_response(list.empty() ? 200 : 503, {{"ready", list.empty()}, {"problems", list}});
}

}  // namespace

void add_health_routes(http::Router& router, RecordingRoutes parts) {
  router.add({"GET", "/healthz", identity::Scope::anyone, {}, with(parts, get_healthz)});
  router.add({"GET", "/readyz", identity::Scope::anyone, {}, with(parts, get_readyz)});
}

}  // namespace server::api
