// SQL that makes runs of what is recorded, and that changes what is said of them.
#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <utility>

#include "server/storage/database/statement.hpp"
#include "server/storage/runs/run_spans.hpp"
#include "server/storage/runs/run_store.hpp"
#include "server/storage/samples/in_force_store.hpp"

namespace server::storage {
namespace {

constexpr std::size_t kMaxDiscardReasonBytes = 200;  // of a text that stands in run_note as a whole
constexpr std::array<const char*, 8> kTextColumns{"name",          "fluid",   "pump_profile", "tube",
                                                  "operator_name", "profile", "notes",        "verdict"};

Result<RunState> state_of(SQLite::Database& database, RunId id) {
  const std::optional<RunState> state = read_run_state(database, id);
  if (!state) return fail(ErrorCode::not_found, fmt::format("there is no run {}", id));
  return *state;
}

}  // namespace

std::optional<RunId> RunStore::add_afterwards(Run run, const RecordedSamples& samples, const station::Author& by) {
  SQLite::Transaction transaction{handle_, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement stored{handle_, "SELECT 1 FROM segment WHERE boot_key = ? LIMIT 1"};
  run.state = RunState::ended;
  run.made_afterwards = true;
  run.firmware_version = samples.firmware_version;
  run.controller_id = samples.controller_id;
  run.started_at_us = samples.started_at_us;
  run.ended_at_us = samples.ended_at_us;
  const RunId id = insert(run);
  SQLite::Statement add{handle_,
                        "INSERT INTO run_span (run_id, span, boot_key, first_seq, last_seq) VALUES (?, ?, ?, ?, ?)"};
  for (std::size_t span = 0; span < samples.boots.size(); ++span) {
    const BootSamples& boot = samples.boots[span];
    bind_all(stored, boot.boot_key);
    if (samples.by_time && !stored.executeStep()) return std::nullopt;
    execute(add, id, static_cast<std::int64_t>(span), boot.boot_key, boot.samples.first, boot.samples.next - 1);
  }
  stored.reset();
  note_in_audit(id, run.robot_id, "run.made", {{"name", run.conditions.name}, {"afterwards", true}}, by);
  transaction.commit();
  return id;
}

Result<void> RunStore::annotate(RunId id, const RunAnnotation& annotation, const station::Author& by) {
  SQLite::Transaction transaction{handle_, SQLite::TransactionBehavior::IMMEDIATE};
  const Result<RunState> state = state_of(handle_, id);
  if (!state) return std::unexpected{state.error()};
  if (*state == RunState::discarded) {
    return fail(ErrorCode::conflict, fmt::format("run {} was discarded", id));
  }
  nlohmann::json changed = nlohmann::json::array();
  const auto change = [&](const std::string& column, const auto& after, const std::string& after_text) {
    SQLite::Statement before{handle_, fmt::format("SELECT {} FROM run WHERE run_id = ?", column)};
    bind_all(before, id);
    before.executeStep();
    const std::string before_text = before.getColumn(0).getString();
    before.reset();
    if (before_text == after_text) return;
    SQLite::Statement update{handle_, fmt::format("UPDATE run SET {} = ?2 WHERE run_id = ?1", column)};
    execute(update, id, after);
    add_note(id, by, column, before_text, after_text);
    changed.push_back(column);
  };
  for (const char* column : kTextColumns) {
    if (const auto given = annotation.texts.find(column); given != annotation.texts.end()) {
      change(column, given->second, given->second);
    }
  }
  if (annotation.has_mean_flow) {
    const std::optional<double>& flow = annotation.mean_flow_m_s;
    change("mean_flow_m_s", flow, flow ? fmt::format("{}", *flow) : "");
  }
  if (!changed.empty()) note_in_audit(id, robot_of(handle_, id), "run.annotated", {{"changed", changed}}, by);
  transaction.commit();
  return {};
}

Result<void> RunStore::discard(RunId id, const std::string& reason, const station::Author& by) {
  SQLite::Transaction transaction{handle_, SQLite::TransactionBehavior::IMMEDIATE};
  const Result<RunState> state = state_of(handle_, id);
  if (!state) return std::unexpected{state.error()};
  if (*state == RunState::open) return fail(ErrorCode::conflict, fmt::format("run {} is open; end it first", id));
  if (*state == RunState::discarded) return fail(ErrorCode::conflict, fmt::format("run {} was discarded already", id));
  SQLite::Statement mark{handle_, "UPDATE run SET state = 'discarded' WHERE run_id = ?"};
  execute(mark, id);
  add_note(id, by, "state", text(*state), "discarded");
  add_note(id, by, "discard_reason", "", reason);
  note_in_audit(id, robot_of(handle_, id), "run.discarded", {{"reason", reason.substr(0, kMaxDiscardReasonBytes)}}, by);
  transaction.commit();
  return {};
}

void RunStore::add_note(RunId id, const station::Author& author, const std::string& field, const std::string& before,
                        const std::string& after) {
  SQLite::Statement add{
      handle_, "INSERT INTO run_note (run_id, made_at_us, actor, field, before, after) VALUES (?, ?, ?, ?, ?, ?)"};
  execute(add, id, author.at_us, author.actor, field, before, after);
}

// In each span of the run, unless it was already.
void RunStore::put_in_force(RunId id, const std::string& station_document, std::int64_t utc_us) {
  if (station_document.empty()) return;
  const std::int64_t key = document_key(handle_, "station", station_document);
  SQLite::Statement put{
      handle_,
      "INSERT OR REPLACE INTO in_force SELECT boot_key, 'station', first_seq, ?2, ?3 FROM run_span WHERE run_id = ?1"
      " AND ?2 IS NOT (SELECT document_key FROM in_force WHERE in_force.boot_key = run_span.boot_key"
      " AND kind = 'station' AND in_force.first_seq <= run_span.first_seq ORDER BY in_force.first_seq DESC LIMIT 1)"};
  execute(put, id, key, utc_us);
}

}  // namespace server::storage
