// The recording as such: its health, its figures for Prometheus, and backups.
#include "server/api/bodies/limits.hpp"
#include "server/api/routes/metrics.hpp"
#include "server/api/routes/routes.hpp"
#include "server/net/transport_security.hpp"
#include "server/station/station.hpp"
#include "server/storage/recording_parts.hpp"

namespace server {
using nlohmann::json;

namespace {

json text_or_null(const std::string& text) { return text.empty() ? json(nullptr) : json(text); }

json to_json(const RecorderCounters& counters) {
  return {{"samples_written", counters.samples_written},
          {"samples_duplicate", counters.samples_duplicate},
          {"samples_refused", counters.samples_refused},
          {"samples_lost", counters.samples_lost},
          {"records_refused", counters.records_refused},
          {"batches_malformed", counters.batches_malformed},
          {"events_asked_again", counters.events_asked_again},
          {"largest_commit_samples", counters.largest_commit_samples},
          {"commits", counters.commits},
          {"commits_failed", counters.commits_failed}};
}

json to_json(const Retention& retention) {
  return {{"retention_days", retention.policy().retention_days},
          {"max_database_bytes", retention.policy().max_database_bytes},
          {"samples_purged", retention.counters().samples_purged},
          {"bytes_returned", retention.counters().pages_returned * 4096},
          {"longest_step_ms", static_cast<double>(retention.counters().longest_step_us) / 1000},
          {"all_held", retention.counters().all_held}};
}

json to_json(const StoreLoss& loss) { return {{"noticed_at_us", loss.noticed_at_us}, {"problem", loss.problem}}; }

json to_json(const BackupRecord& backup) {
  return {{"name", backup.name},
          {"state", text(backup.state)},
          {"pages_done", backup.pages_done},
          {"pages_total", backup.pages_total},
          {"problem", text_or_null(backup.problem)},
          {"path", backup.path.string()}};
}

Answer get_recording(RecordingRoutes parts, Request) {
  const RecordingParts& recording = parts.recording;
  const bool failing = recording.recorder.failing();
  const bool has_room = recording.disk_watch.state() == SpaceState::ok;
  const DiskUse& use = recording.disk_watch.use();
  const WalState& wal = recording.recorder.wal();
  const std::int64_t held_us = parts.clock.utc_us() - wal.held_since_us;
  co_return json_response(
      200, {{"state", failing    ? "failing"
                      : has_room ? "recording"
                                 : "low_space"},
            {"problem", text_or_null(failing ? recording.recorder.problem() : recording.disk_watch.problem())},
            {"space", text(recording.disk_watch.state())},
            {"queued_samples", recording.recorder.queued_samples()},
            {"free_bytes", use.free_bytes},
            {"database_bytes", use.database_bytes},
            {"wal_bytes", wal.bytes},
            {"wal_held_s", wal.held_since_us == 0 ? 0 : static_cast<double>(held_us) / 1e6},
            {"losses", losses_json(recording.head_watch.losses())},
            {"counters", to_json(recording.recorder.counters())},
            {"retention", to_json(recording.retention)}});
}

Answer acknowledge_losses(RecordingRoutes parts, Request request) {
  const Author by = author_of(request, parts.clock);
  const auto done = co_await parts.recording.head_watch.acknowledge(by);
  if (!done) co_return problem(done.error());
  co_return json_response(200, json::object());
}

Answer get_metrics(RecordingRoutes parts, Request) {
  Response response;
  response.content_type = "text/plain; version=0.0.4";
  response.body = metrics_text(parts.recording, parts.station, parts.security, parts.exceptions);
  co_return response;
}

Answer list_backups(RecordingRoutes parts, Request) {
  const std::vector<BackupRecord> backups = co_await parts.recording.backups.list();
  json list = json::array();
  for (const BackupRecord& backup : backups) list.push_back(to_json(backup));
  co_return json_response(200, {{"backups", std::move(list)}});
}

Answer create_backup(RecordingRoutes parts, Request request) {
  const auto body = Members::parse(request.body, {"name"});
  if (!body) co_return problem(body.error());
  const auto name = body->text("name", {1, kMaxWordBytes});
  if (!name) co_return problem(name.error());
  const auto backup = co_await parts.recording.backups.begin(*name);
  if (!backup) co_return problem(backup.error());
  co_return json_response(202, to_json(*backup));
}

}  // namespace

json losses_json(const std::vector<StoreLoss>& losses) {
  json list = json::array();
  for (const StoreLoss& loss : losses) list.push_back(to_json(loss));
  return list;
}

void add_recording_routes(Router& router, RecordingRoutes parts) {
  const auto add = [&router, parts](const char* method, const char* pattern, Scope needs,
                                    Answer (*answer)(RecordingRoutes, Request)) {
    router.add({method, pattern, needs, {}, with(parts, answer)});
  };
  add("GET", "/metrics", Scope::read, get_metrics);
  add("GET", "/api/v1/recording", Scope::read, get_recording);
  add("POST", "/api/v1/recording/losses/acknowledge", Scope::admin, acknowledge_losses);
  add("GET", "/api/v1/backups", Scope::read, list_backups);
  add("POST", "/api/v1/backups", Scope::admin, create_backup);
}

}  // namespace server
