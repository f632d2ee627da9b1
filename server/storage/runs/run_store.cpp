// SQL that changes runs.
#include "server/storage/runs/run_store.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "server/storage/audit/audit_chain.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/runs/run_spans.hpp"

namespace server::storage {
namespace {

constexpr std::size_t kMaxNotedVerdictBytes = 200;  // of a verdict, which stands in the run as a whole

}  // namespace

station::RobotId robot_of(SQLite::Database& database, RunId run) {
  SQLite::Statement query{database, "SELECT robot_id FROM run WHERE run_id = ?"};
  bind_all(query, run);
  return query.executeStep() ? query.getColumn(0).getString() : station::RobotId{};
}

Result<RunId> RunStore::add(const Run& run, const std::string& station_document, const station::Author& by) {
  SQLite::Transaction transaction{handle_, SQLite::TransactionBehavior::IMMEDIATE};
  const RunSpan& span = run.spans.front();
  SQLite::Statement boot{handle_, "SELECT boot_key FROM boot WHERE boot_id = ? AND ended_next_seq IS NULL"};
  bind_all(boot, span.boot_id);
  if (!boot.executeStep()) {
    return fail(ErrorCode::not_connected, fmt::format("robot '{}' has rebooted just now; try again", run.robot_id));
  }
  const RunId id = insert(run);
  SQLite::Statement add_span{handle_, "INSERT INTO run_span (run_id, span, boot_key, first_seq) VALUES (?, 0, ?, ?)"};
  execute(add_span, id, boot.getColumn(0).getInt64(), span.first_seq);
  boot.reset();
  put_in_force(id, station_document, run.started_at_us);
  note_in_audit(id, run.robot_id, "run.made", {{"name", run.conditions.name}}, by);
  transaction.commit();
  return id;
}

RunId RunStore::insert(const Run& run) {
  const RunConditions& conditions = run.conditions;
  SQLite::Statement add_run{
      handle_, fmt::format("INSERT INTO run ({}) VALUES (NULL,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)", kRunColumns)};
  execute(add_run, run.robot_id, conditions.name, conditions.fluid, conditions.pump_profile, conditions.mean_flow_m_s,
          conditions.tube, conditions.operator_name, conditions.notes, conditions.verdict, run.firmware_version,
          run.controller_id, run.controller_checksum, run.parameters_checksum, run.started_at_us, run.ended_at_us,
          text(run.state), run.made_afterwards ? 1U : 0U, run.made_by, conditions.profile);
  return handle_.getLastInsertRowid();
}

void RunStore::end(RunId id, const RunEnd& end) {
  SQLite::Statement of_boot{handle_,
                            "SELECT span, boot_key FROM run_span JOIN boot USING (boot_key)"
                            " WHERE run_id = ? AND boot_id = ? ORDER BY span DESC LIMIT 1"};
  bind_all(of_boot, id, end.boot_id);
  if (of_boot.executeStep()) {
    const std::int64_t span = of_boot.getColumn(0).getInt64(), boot_key = of_boot.getColumn(1).getInt64();
    of_boot.reset();
    close_span(id, span, boot_key, end.next_seq);
  } else {
    close_open_span(id);
  }
  SQLite::Statement mark{
      handle_,
      "UPDATE run SET ended_at_us = ?2, state = 'ended', verdict = CASE ?3 WHEN '' THEN verdict ELSE ?3 END"
      " WHERE run_id = ?1"};
  execute(mark, id, end.by.at_us, end.verdict);
  put_in_force(id, end.station_document, end.by.at_us);  // in the spans that reboots have begun
  const std::string noted = end.verdict.substr(0, kMaxNotedVerdictBytes);
  note_in_audit(id, robot_of(handle_, id), "run.ended", {{"verdict", noted}}, end.by);
}

std::vector<RunId> RunStore::interrupt(std::int64_t utc_us) {
  SQLite::Transaction transaction{handle_, SQLite::TransactionBehavior::IMMEDIATE};
  std::vector<RunId> open;
  SQLite::Statement query{handle_, "SELECT run_id FROM run WHERE ended_at_us IS NULL"};
  while (query.executeStep()) open.push_back(query.getColumn(0).getInt64());
  SQLite::Statement last_span{handle_,
                              "SELECT boot_key, last_seq FROM run_span WHERE run_id = ? ORDER BY span DESC LIMIT 1"};
  SQLite::Statement mark{
      handle_, "UPDATE run SET ended_at_us = max(started_at_us, ?2), state = 'interrupted' WHERE run_id = ?1"};
  for (const RunId id : open) {
    close_open_span(id);
    bind_all(last_span, id);
    std::optional<SampleTime> last;
    if (last_span.executeStep()) {
      last = time_of(handle_, last_span.getColumn(0).getInt64(), unsigned_id(last_span.getColumn(1)));
    }
    execute(mark, id, last ? last->utc_us : 0);
    note_in_audit(id, robot_of(handle_, id), "run.interrupted", nlohmann::json::object(), {"station", "", utc_us});
  }
  last_span.reset();
  transaction.commit();
  return open;
}

void RunStore::note_in_audit(RunId id, const station::RobotId& robot_id, const char* action,
                             const nlohmann::json& detail, const station::Author& by) {
  station::AuditNote note;
  note.by = by;
  note.robot_id = robot_id;
  note.action = action;
  note.subject = std::to_string(id);
  note.detail = station::audit_detail(detail);
  AuditChain{handle_}.append(note);
}

void RunStore::close_open_span(RunId id) {
  SQLite::Statement open{handle_,
                         "SELECT span, boot_key, boot.boot_id FROM run_span JOIN boot USING (boot_key)"
                         " WHERE run_id = ? AND last_seq IS NULL"};
  bind_all(open, id);
  if (!open.executeStep()) return;
  const std::int64_t span = open.getColumn(0).getInt64(), boot_key = open.getColumn(1).getInt64();
  const std::uint64_t next = known_next_seq(handle_, {}, boot_key, unsigned_id(open.getColumn(2)));
  open.reset();
  close_span(id, span, boot_key, next);
}

void RunStore::close_span(RunId id, std::int64_t span, std::int64_t boot_key, std::uint64_t next_seq) {
  SQLite::Statement drop{handle_,
                         "DELETE FROM run_span WHERE run_id = ?1 AND (span > ?2 OR span = ?2 AND first_seq >= ?3)"};
  execute(drop, id, span, next_seq);
  SQLite::Statement close{handle_,
                          "UPDATE run_span SET last_seq = min(coalesce(last_seq, ?3 - 1), ?3 - 1)"
                          " WHERE run_id = ?1 AND span = ?2"};
  execute(close, id, span, next_seq);
  // The station has received these samples, though they need not be stored yet: if they never are, they count as lost.
  SQLite::Statement made{handle_,
                         "UPDATE boot SET announced_next_seq = max(announced_next_seq, ?2) WHERE boot_key = ?1"};
  execute(made, boot_key, next_seq);
}

}  // namespace server::storage
