// SQL of runs. Counts of a span that is complete are kept with it, since they never change again.
#include "server/recording/run_store.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "server/recording/statement.hpp"

namespace server {
namespace {

constexpr const char* kRunColumns =
    "run_id, robot_id, name, fluid, pump_profile, mean_flow_m_s, tube, operator_name, notes, verdict,"
    " firmware_version, controller_id, controller_checksum, parameters_checksum, started_at_us, ended_at_us, state,"
    " made_afterwards, made_by, profile";

RunState state_from(const std::string& name) {
  for (const RunState state : {RunState::ended, RunState::interrupted, RunState::discarded}) {
    if (name == text(state)) return state;
  }
  return RunState::open;
}

Run run_from(SQLite::Statement& row) {
  Run run;
  run.id = row.getColumn(0).getInt64();
  run.robot_id = row.getColumn(1).getString();
  run.conditions.name = row.getColumn(2).getString();
  run.conditions.fluid = row.getColumn(3).getString();
  run.conditions.pump_profile = row.getColumn(4).getString();
  if (!row.getColumn(5).isNull()) run.conditions.mean_flow_m_s = row.getColumn(5).getDouble();
  run.conditions.tube = row.getColumn(6).getString();
  run.conditions.operator_name = row.getColumn(7).getString();
  run.conditions.notes = row.getColumn(8).getString();
  run.conditions.verdict = row.getColumn(9).getString();
  run.firmware_version = row.getColumn(10).getString();
  run.controller_id = row.getColumn(11).getUInt();
  run.controller_checksum = row.getColumn(12).getUInt();
  run.parameters_checksum = row.getColumn(13).getUInt();
  run.started_at_us = row.getColumn(14).getInt64();
  if (!row.getColumn(15).isNull()) run.ended_at_us = row.getColumn(15).getInt64();
  run.state = state_from(row.getColumn(16).getString());
  run.made_afterwards = row.getColumn(17).getInt() != 0;
  run.made_by = row.getColumn(18).getString();
  run.conditions.profile = row.getColumn(19).getString();
  return run;
}

}  // namespace

std::map<RobotId, RunId> RunStore::open_runs() {
  std::map<RobotId, RunId> runs;
  SQLite::Statement query{handle_, "SELECT robot_id, run_id FROM run WHERE ended_at_us IS NULL"};
  while (query.executeStep()) runs.emplace(query.getColumn(0).getString(), query.getColumn(1).getInt64());
  return runs;
}

Result<RunId> RunStore::add(const Run& run) {
  SQLite::Transaction transaction{handle_, SQLite::TransactionBehavior::IMMEDIATE};
  const RunSpan& span = run.spans.front();
  SQLite::Statement boot{handle_, "SELECT boot_key FROM boot WHERE boot_id = ? AND ended_next_seq IS NULL"};
  bind_all(boot, span.boot_id);
  if (!boot.executeStep()) {
    return fail(ErrorCode::not_connected, fmt::format("robot '{}' has rebooted just now; try again", run.robot_id));
  }
  const RunConditions& conditions = run.conditions;
  SQLite::Statement add_run{
      handle_, fmt::format("INSERT INTO run ({}) VALUES (NULL,?,?,?,?,?,?,?,?,?,?,?,?,?,?,NULL,?,?,?,?)", kRunColumns)};
  execute(add_run, run.robot_id, conditions.name, conditions.fluid, conditions.pump_profile, conditions.mean_flow_m_s,
          conditions.tube, conditions.operator_name, conditions.notes, conditions.verdict, run.firmware_version,
          run.controller_id, run.controller_checksum, run.parameters_checksum, run.started_at_us, text(run.state),
          run.made_afterwards ? 1U : 0U, run.made_by, conditions.profile);
  const RunId id = handle_.getLastInsertRowid();
  SQLite::Statement add_span{handle_, "INSERT INTO run_span (run_id, span, boot_key, first_seq) VALUES (?, 0, ?, ?)"};
  execute(add_span, id, boot.getColumn(0).getInt64(), span.first_seq);
  boot.reset();
  transaction.commit();
  return id;
}

void RunStore::end(RunId id, const std::string& verdict, std::int64_t utc_us) {
  SQLite::Transaction transaction{handle_, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement open{handle_,
                         "SELECT run_span.boot_key, boot.boot_id FROM run_span JOIN boot USING (boot_key)"
                         " WHERE run_id = ? AND last_seq IS NULL"};
  bind_all(open, id);
  if (open.executeStep()) {
    const std::uint64_t next = next_seq(open.getColumn(0).getInt64(), unsigned_id(open.getColumn(1)));
    open.reset();
    SQLite::Statement drop{handle_, "DELETE FROM run_span WHERE run_id = ? AND last_seq IS NULL AND first_seq >= ?"};
    execute(drop, id, next);
    SQLite::Statement close{handle_, "UPDATE run_span SET last_seq = ?2 - 1 WHERE run_id = ?1 AND last_seq IS NULL"};
    execute(close, id, next);
  }
  SQLite::Statement mark{
      handle_,
      "UPDATE run SET ended_at_us = ?2, state = 'ended', verdict = CASE ?3 WHEN '' THEN verdict ELSE ?3 END"
      " WHERE run_id = ?1"};
  execute(mark, id, utc_us, verdict);
  transaction.commit();
}

std::optional<Run> RunStore::find(RunId id) {
  SQLite::Statement query{handle_, fmt::format("SELECT {} FROM run WHERE run_id = ?", kRunColumns)};
  bind_all(query, id);
  std::vector<Run> runs = read_runs(query);
  if (runs.empty()) return std::nullopt;
  return std::move(runs.front());
}

std::vector<Run> RunStore::list(const std::optional<RobotId>& robot_id, RunId before, std::size_t limit) {
  SQLite::Statement query{handle_, fmt::format("SELECT {} FROM run WHERE (?1 IS NULL OR robot_id = ?1)"
                                               " AND (?2 = 0 OR run_id < ?2) ORDER BY run_id DESC LIMIT ?3",
                                               kRunColumns)};
  bind_all(query, robot_id, before, static_cast<std::int64_t>(limit));
  return read_runs(query);
}

std::vector<Run> RunStore::read_runs(SQLite::Statement& query) {
  std::vector<Run> runs;
  while (query.executeStep()) runs.push_back(run_from(query));
  for (Run& run : runs) read_spans(run);
  return runs;
}

void RunStore::read_spans(Run& run) {
  SQLite::Statement query{handle_,
                          "SELECT span, boot_key, boot_id, first_seq, last_seq, samples_stored, samples_lost"
                          " FROM run_span JOIN boot USING (boot_key) WHERE run_id = ? ORDER BY span"};
  SQLite::Statement keep{handle_,
                         "UPDATE run_span SET samples_stored = ?, samples_lost = ? WHERE run_id = ? AND span = ?"};
  bind_all(query, run.id);
  while (query.executeStep()) {
    const std::int64_t boot_key = query.getColumn(1).getInt64();
    RunSpan span{
        .boot_id = unsigned_id(query.getColumn(2)), .first_seq = unsigned_id(query.getColumn(3)), .last_seq = {}};
    if (!query.getColumn(4).isNull()) span.last_seq = unsigned_id(query.getColumn(4));
    const std::uint64_t next = span.last_seq ? *span.last_seq + 1 : next_seq(boot_key, span.boot_id);
    run.spans.push_back(span);
    if (next <= span.first_seq) continue;
    const bool counted = !query.getColumn(5).isNull();
    const auto stored = counted ? query.getColumn(5).getInt64() : count_stored(boot_key, span.first_seq, next - 1);
    const auto lost = counted ? query.getColumn(6).getInt64() : count_lost(boot_key, span.first_seq, next - 1);
    const auto expected = static_cast<std::int64_t>(next - span.first_seq);
    if (span.last_seq && !counted && stored + lost == expected) {
      execute(keep, stored, lost, run.id, query.getColumn(0).getInt64());
    }
    run.samples_expected += static_cast<std::uint64_t>(expected);
    run.samples_stored += static_cast<std::uint64_t>(stored);
    run.samples_lost += static_cast<std::uint64_t>(lost);
  }
}

std::uint64_t RunStore::next_seq(std::int64_t boot_key, BootId boot_id) {
  SQLite::Statement query{
      handle_,
      "SELECT max(announced_next_seq,"
      " coalesce((SELECT last_seq + 1 FROM segment WHERE boot_key = ?1 ORDER BY first_seq DESC LIMIT 1), 0),"
      " coalesce((SELECT last_seq + 1 FROM gap WHERE boot_key = ?1 ORDER BY first_seq DESC LIMIT 1), 0))"
      " FROM boot WHERE boot_key = ?1"};
  bind_all(query, boot_key);
  query.executeStep();
  const auto head = heads_.find(boot_id);
  return std::max(unsigned_id(query.getColumn(0)), head == heads_.end() ? 0 : head->second);
}

std::int64_t RunStore::count_stored(std::int64_t boot_key, std::uint64_t first_seq, std::uint64_t last_seq) {
  SQLite::Statement query{handle_,
                          "SELECT coalesce(sum(min(last_seq, ?3) - max(first_seq, ?2) + 1), 0) FROM segment"
                          " WHERE boot_key = ?1 AND first_seq BETWEEN ?2 - 99 AND ?3 AND last_seq >= ?2"};
  bind_all(query, boot_key, first_seq, last_seq);
  query.executeStep();
  return query.getColumn(0).getInt64();
}

std::int64_t RunStore::count_lost(std::int64_t boot_key, std::uint64_t first_seq, std::uint64_t last_seq) {
  SQLite::Statement query{handle_,
                          "SELECT coalesce(sum(min(last_seq, ?3) - max(first_seq, ?2) + 1), 0) FROM gap"
                          " WHERE boot_key = ?1 AND first_seq <= ?3 AND last_seq >= ?2"};
  bind_all(query, boot_key, first_seq, last_seq);
  query.executeStep();
  return query.getColumn(0).getInt64();
}

}  // namespace server
