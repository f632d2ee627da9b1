// The recording as such: its health, its figures for Prometheus, and backups.
#include "server/api/bodies/limits.hpp"
#include "server/api/routes/metrics.hpp"
#include "server/api/routes/routes.hpp"
#include "server/net/transport_security.hpp"
#include "server/station/station.hpp"
#include "server/storage/recording_parts.hpp"

namespace server::api {
using nlohmann::json;

namespace {

json text_or_null(const std::string& text) { return text.empty() ? json(nullptr) : json(text); }

json to_json(const storage::RecorderCounters& counters) {
  return {{"samples_written", counters.samples_written},
          {"samples_duplicate", counters.samples_duplicate},
          {"samples_refused", counters.samples_refused},
          {"samples_lost", counters.samples_lost},
          {"samples_given_up", counters.samples_given_up},
          {"samples_returned", counters.samples_returned},
          {"records_refused", counters.records_refused},
          {"batches_malformed", counters.batches_malformed},
          {"events_asked_again", counters.events_asked_again},
          {"largest_commit_samples", counters.largest_commit_samples},
          {"commits", counters.commits},
          {"commits_failed", counters.commits_failed}};
}

json to_json(const storage::Retention& retention) {
  return {{"retention_days", retention.policy().retention_days},
          {"event_retention_days", retention.policy().event_retention_days},
          {"max_database_bytes", retention.policy().max_database_bytes},
          {"samples_purged", retention.counters().samples_purged},
          {"events_purged", retention.counters().events_purged},
          {"bytes_returned", retention.counters().pages_returned * 4096},
          {"longest_step_ms", static_cast<double>(retention.counters().longest_step_us) / 1000},
          {"all_held", retention.counters().all_held}};
}

json to_json(const storage::StoreLoss& loss) {
  return {{"noticed_at_us", loss.noticed_at_us}, {"problem", loss.problem}};
}

json to_json(const storage::BackupRecord& backup) {
  return {{"name", backup.name},
          {"state", text(backup.state)},
          {"pages_done", backup.pages_done},
          {"pages_total", backup.pages_total},
          {"problem", text_or_null(backup.problem)},
          {"path", backup.path.string()}};
}

http::Answer get_recording(RecordingRoutes parts, http::Request) {
  const storage::RecordingParts& recording = parts.recording;
  const bool failing = recording.recorder.failing();
  const bool has_room = recording.disk_watch.state() == storage::SpaceState::ok;
  const storage::DiskUse& use = recording.disk_watch.use();
  const storage::WalState& wal = recording.recorder.wal();
  const std::int64_t held_us = parts.clock.utc_us() - wal.held_since_us;
  co_return http::json_response(
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
            {"clock_is_doubted", recording.removal_clock.is_doubted()},
            {"counters", to_json(recording.recorder.counters())},
            {"retention", to_json(recording.retention)}});
}

http::Answer acknowledge_losses(RecordingRoutes parts, http::Request request) {
  const station::Author by = author_of(request, parts.clock);
  const auto done = co_await parts.recording.head_watch.acknowledge(by);
  if (!done) co_return http::problem(done.error());
  co_return http::json_response(200, json::object());
}

http::Answer accept_clock(RecordingRoutes parts, http::Request request) {
  if (!parts.recording.removal_clock.is_doubted()) {
    co_return http::problem(409, "nothing is doubted of the clock", "conflict");
  }
  parts.recording.removal_clock.accept();
  station::AuditNote note;
  note.by = author_of(request, parts.clock);
  note.action = "station.clock_accepted";
  parts.recording.recorder.on_audit(note);
  co_return http::json_response(200, json::object());
}

http::Answer get_metrics(RecordingRoutes parts, http::Request) {
  http::Response response;
  response.content_type = "text/plain; version=0.0.4";
  response.body = metrics_text(parts);
  co_return response;
}

http::Answer list_backups(RecordingRoutes parts, http::Request) {
  const std::vector<storage::BackupRecord> backups = co_await parts.recording.backups.list();
  json list = json::array();
  for (const storage::BackupRecord& backup : backups) list.push_back(to_json(backup));
  co_return http::json_response(200, {{"backups", std::move(list)}});
}

http::Answer create_backup(RecordingRoutes parts, http::Request request) {
  const auto body = Members::parse(request.body, {"name"});
  if (!body) co_return http::problem(body.error());
  const auto name = body->text("name", {1, kMaxWordBytes});
  if (!name) co_return http::problem(name.error());
  const auto backup = co_await parts.recording.backups.begin(*name);
  if (!backup) co_return http::problem(backup.error());
  co_return http::json_response(202, to_json(*backup));
}

}  // namespace

json losses_json(const std::vector<storage::StoreLoss>& losses) {
  json list = json::array();
  for (const storage::StoreLoss& loss : losses) list.push_back(to_json(loss));
  return list;
}

void add_recording_routes(http::Router& router, RecordingRoutes parts) {
  const auto add = [&router, parts](const char* method, const char* pattern, identity::Scope needs,
                                    http::Answer (*answer)(RecordingRoutes, http::Request)) {
    router.add({method, pattern, needs, {}, with(parts, answer)});
  };
  add("GET", "/metrics", identity::Scope::read, get_metrics);
  add("GET", "/api/v1/recording", identity::Scope::read, get_recording);
  add("POST", "/api/v1/recording/losses/acknowledge", identity::Scope::admin, acknowledge_losses);
  add("POST", "/api/v1/recording/clock/accept", identity::Scope::admin, accept_clock);
  add("GET", "/api/v1/backups", identity::Scope::read, list_backups);
  add("POST", "/api/v1/backups", identity::Scope::admin, create_backup);
}

}  // namespace server::api
