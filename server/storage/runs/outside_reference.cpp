// SQL of references; each call is a few statements.
#include "server/storage/runs/outside_reference.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "server/storage/audit/audit_chain.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/runs/run_queries.hpp"
#include "server/storage/runs/run_spans.hpp"
#include "server/storage/runs/run_store.hpp"

namespace server::storage {
namespace {

constexpr std::int64_t kSchemaSince = 7;
constexpr std::size_t kMaxNotedReasonBytes = 200;  // of a reason
constexpr const char* kInUse = "completed_at_us IS NOT NULL AND removed_at_us IS NULL";
constexpr const char* kReferenceColumns =
    "reference_id, run_id, span, source, sha256, clock_method, clock_offset_s, clock_sd_s, correlation, motion_ratio,"
    " zero_is_kept, zero_offset_m, zero_sd_m, samples, samples_left_out, actor, made_at_us";

bool has_references(SQLite::Database& database) {
  return database.execAndGet("PRAGMA user_version").getInt64() >= kSchemaSince;
}

std::optional<double> optional_number(const SQLite::Column& column) {
  return column.isNull() ? std::nullopt : std::optional{column.getDouble()};
}

ReferenceClock clock_from(const std::string& word) {
  for (const auto value : {ReferenceClock::utc, ReferenceClock::marker, ReferenceClock::correlation}) {
    if (word == text(value)) return value;
  }
  return ReferenceClock::offset;
}

OutsideReference reference_from(SQLite::Statement& row) {
  OutsideReference found;
  found.id = row.getColumn(0).getInt64();
  found.run = row.getColumn(1).getInt64();
  found.span = row.getColumn(2).getUInt();
  found.source = row.getColumn(3).getString();
  found.sha256 = row.getColumn(4).getString();
  found.clock = clock_from(row.getColumn(5).getString());
  found.clock_offset_s = row.getColumn(6).getDouble();
  found.clock_sd_s = optional_number(row.getColumn(7));
  found.correlation = optional_number(row.getColumn(8));
  found.motion_ratio = optional_number(row.getColumn(9));
  found.zero_is_kept = row.getColumn(10).getInt() != 0;
  found.zero_offset_m = row.getColumn(11).getDouble();
  found.zero_sd_m = optional_number(row.getColumn(12));
  found.samples = unsigned_id(row.getColumn(13));
  found.samples_left_out = unsigned_id(row.getColumn(14));
  found.actor = row.getColumn(15).getString();
  found.made_at_us = row.getColumn(16).getInt64();
  return found;
}

void note_in_audit(SQLite::Database& database, RunId run, const char* action, const nlohmann::json& detail,
                   const station::Author& by) {
  station::AuditNote note;
  note.by = by;
  note.robot_id = robot_of(database, run);
  note.action = action;
  note.subject = std::to_string(run);
  note.detail = station::audit_detail(detail);
  AuditChain{database}.append(note);
}

void mark_removed(SQLite::Database& database, std::int64_t reference, const std::string& reason,
                  const station::Author& by) {
  SQLite::Statement mark{database,
                         "UPDATE outside_reference SET removed_at_us = ?2, removed_by = ?3, removed_reason = ?4"
                         " WHERE reference_id = ?1"};
  execute(mark, reference, by.at_us, by.actor, reason);
}

}  // namespace

const char* text(ReferenceClock value) {
  switch (value) {
    case ReferenceClock::offset: return "offset";
    case ReferenceClock::utc: return "utc";
    case ReferenceClock::marker: return "marker";
    case ReferenceClock::correlation: return "correlation";
  }
  return "";
}

std::optional<OutsideReference> find_reference(SQLite::Database& database, RunId run) {
  if (!has_references(database)) return std::nullopt;
  SQLite::Statement query{database,
                          fmt::format("SELECT {} FROM outside_reference WHERE run_id = ?1 AND {} AND NOT EXISTS (SELECT"
                                      " 1 FROM run WHERE run.run_id = ?1 AND state = 'discarded')",
                                      kReferenceColumns, kInUse)};
  bind_all(query, run);
  if (!query.executeStep()) return std::nullopt;
  return reference_from(query);
}

OutsidePositions read_positions(SQLite::Database& database, std::int64_t reference,
                                std::optional<std::uint64_t> after_us, std::size_t limit) {
  OutsidePositions positions;
  SQLite::Statement query{database,
                          "SELECT robot_time_us, position_m, position_sd_m FROM outside_position"
                          " WHERE reference_id = ? AND robot_time_us > ? ORDER BY robot_time_us LIMIT ?"};
  bind_all(query, reference, after_us ? static_cast<std::int64_t>(*after_us) : std::int64_t{-1},
           static_cast<std::int64_t>(limit));
  while (query.executeStep()) {
    positions.robot_time_us.push_back(unsigned_id(query.getColumn(0)));
    positions.position_m.push_back(query.getColumn(1).getDouble());
    positions.position_sd_m.push_back(query.getColumn(2).getDouble());
  }
  return positions;
}

std::optional<StoredReference> read_reference(SQLite::Database& database, RunId run,
                                              std::optional<std::uint64_t> after_us, std::size_t limit) {
  const SQLite::Transaction one_moment{database};
  auto found = find_reference(database, run);
  if (!found) return std::nullopt;
  OutsidePositions positions = read_positions(database, found->id, after_us, limit);
  return StoredReference{std::move(*found), std::move(positions)};
}

std::optional<StoredReference> read_exported_reference(SQLite::Database& file) {
  if (!file.tableExists("outside_reference")) return std::nullopt;
  SQLite::Statement query{file, fmt::format("SELECT {} FROM outside_reference", kReferenceColumns)};
  if (!query.executeStep()) return std::nullopt;
  StoredReference stored{reference_from(query), {}};
  SQLite::Statement rows{
      file, "SELECT robot_time_us, position_m, position_sd_m FROM outside_position ORDER BY robot_time_us"};
  while (rows.executeStep()) {
    stored.positions.robot_time_us.push_back(unsigned_id(rows.getColumn(0)));
    stored.positions.position_m.push_back(rows.getColumn(1).getDouble());
    stored.positions.position_sd_m.push_back(rows.getColumn(2).getDouble());
  }
  return stored;
}

Error changed_while_read(RunId run) {
  return {ErrorCode::conflict,
          fmt::format("the reference of run {} was replaced or removed while it was read; ask again", run),
          "reference_changed"};
}

Result<void> check_may_import(SQLite::Database& database, RunId run, const std::string& reason) {
  const std::optional<RunState> state = read_run_state(database, run);
  if (!state) return fail(ErrorCode::not_found, fmt::format("there is no run {}", run));
  if (*state == RunState::open) return fail(ErrorCode::conflict, fmt::format("run {} is open; end it first", run));
  if (*state == RunState::discarded) return fail(ErrorCode::conflict, fmt::format("run {} was discarded", run));
  const auto before = find_reference(database, run);
  if (!before || !reason.empty()) return {};
  return fail(ErrorCode::conflict,
              fmt::format("run {} has a reference, {}; give a reason to replace it", run, before->source),
              "has_reference");
}

Result<std::int64_t> begin_reference(SQLite::Database& database, const OutsideReference& made,
                                     const std::string& reason) {
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  if (const auto may = check_may_import(database, made.run, reason); !may) return std::unexpected{may.error()};
  SQLite::Statement add{database, fmt::format("INSERT INTO outside_reference ({}) VALUES"
                                              " (NULL, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                                              kReferenceColumns)};
  execute(add, made.run, made.span, made.source, made.sha256, text(made.clock), made.clock_offset_s, made.clock_sd_s,
          made.correlation, made.motion_ratio, made.zero_is_kept ? 1U : 0U, made.zero_offset_m, made.zero_sd_m,
          made.samples, made.samples_left_out, made.actor, made.made_at_us);
  const std::int64_t id = database.getLastInsertRowid();
  transaction.commit();
  return id;
}

void add_positions(SQLite::Database& database, std::int64_t reference, const OutsidePositions& positions,
                   std::size_t first, std::size_t count) {
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement add{database, "INSERT INTO outside_position VALUES (?, ?, ?, ?)"};
  for (std::size_t i = first; i < std::min(first + count, positions.size()); ++i) {
    execute(add, reference, positions.robot_time_us[i], positions.position_m[i], positions.position_sd_m[i]);
  }
  transaction.commit();
}

Result<void> complete_reference(SQLite::Database& database, std::int64_t reference, const std::string& reason,
                                const station::Author& by) {
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement query{database,
                          fmt::format("SELECT {} FROM outside_reference WHERE reference_id = ?", kReferenceColumns)};
  bind_all(query, reference);
  if (!query.executeStep()) return fail(ErrorCode::not_found, "the reference is not there any more");
  const OutsideReference made = reference_from(query);
  query.reset();
  if (const auto may = check_may_import(database, made.run, reason); !may) return std::unexpected{may.error()};
  nlohmann::json detail{{"source", made.source},
                        {"sha256", made.sha256},
                        {"samples", made.samples},
                        {"clock_method", text(made.clock)},
                        {"clock_offset_s", made.clock_offset_s},
                        {"zero_offset_m", made.zero_offset_m}};
  if (const auto before = find_reference(database, made.run)) {
    mark_removed(database, before->id, reason, by);
    detail["replaces"] = before->source;
    detail["reason"] = reason.substr(0, kMaxNotedReasonBytes);
  }
  SQLite::Statement complete{database, "UPDATE outside_reference SET completed_at_us = ?2 WHERE reference_id = ?1"};
  execute(complete, reference, by.at_us);
  note_in_audit(database, made.run, "run.reference_imported", detail, by);
  transaction.commit();
  return {};
}

Result<void> remove_reference(SQLite::Database& database, RunId run, const std::string& reason,
                              const station::Author& by) {
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  if (!read_run_state(database, run)) return fail(ErrorCode::not_found, fmt::format("there is no run {}", run));
  const auto found = find_reference(database, run);
  if (!found) return fail(ErrorCode::not_found, fmt::format("run {} has no reference", run), "no_reference");
  mark_removed(database, found->id, reason, by);
  note_in_audit(database, run, "run.reference_removed",
                {{"source", found->source}, {"reason", reason.substr(0, kMaxNotedReasonBytes)}}, by);
  transaction.commit();
  return {};
}

Result<OutsideReference> store_reference(SQLite::Database& database, const OutsideReference& reference,
                                         const OutsidePositions& positions, const std::string& reason,
                                         const station::Author& by) {
  const auto id = begin_reference(database, reference, reason);
  if (!id) return std::unexpected{id.error()};
  add_positions(database, *id, positions, 0, positions.size());
  if (const auto done = complete_reference(database, *id, reason, by); !done) return std::unexpected{done.error()};
  while (delete_some_positions(database)) continue;
  return *find_reference(database, reference.run);
}

void remove_unfinished_references(SQLite::Database& database, std::optional<std::int64_t> only, std::int64_t utc_us) {
  SQLite::Statement mark{database,
                         "UPDATE outside_reference SET removed_at_us = ?1, removed_by = 'station',"
                         " removed_reason = 'its import was not finished'"
                         " WHERE completed_at_us IS NULL AND removed_at_us IS NULL"
                         " AND (?2 IS NULL OR reference_id = ?2)"};
  execute(mark, utc_us, only);
}

bool delete_some_positions(SQLite::Database& database) {
  SQLite::Statement find{database,
                         "SELECT reference_id FROM outside_reference JOIN run USING (run_id)"
                         " WHERE (removed_at_us IS NOT NULL OR run.state = 'discarded') AND EXISTS (SELECT 1 FROM"
                         " outside_position WHERE outside_position.reference_id = outside_reference.reference_id)"
                         " LIMIT 1"};
  if (!find.executeStep()) return false;
  const std::int64_t reference = find.getColumn(0).getInt64();
  find.reset();
  SQLite::Statement remove{database,
                           "DELETE FROM outside_position WHERE reference_id = ?1 AND robot_time_us <= (SELECT max(t)"
                           " FROM (SELECT robot_time_us AS t FROM outside_position WHERE reference_id = ?1"
                           " ORDER BY t LIMIT ?2))"};
  execute(remove, reference, static_cast<std::int64_t>(kReferenceSlice));
  return true;
}

Result<MarkerPlace> find_marker(SQLite::Database& database, RunId run, std::optional<std::int64_t> marker_id,
                                const std::string& marker_text) {
  SQLite::Statement query{database,
                          "SELECT span, boot_key, run_marker.seq FROM run_marker JOIN marker USING (marker_id)"
                          " WHERE run_id = ?1 AND (marker_id = ?2 OR (?2 IS NULL AND marker.text = ?3)) LIMIT 2"};
  bind_all(query, run, marker_id, marker_text);
  const std::string name = marker_id ? fmt::format("number {}", *marker_id) : fmt::format("'{}'", marker_text);
  if (!query.executeStep()) {
    return fail(ErrorCode::invalid, fmt::format("run {} has no marker {}", run, name), "unknown_marker");
  }
  const MarkerPlace found{query.getColumn(0).getUInt(), 0};
  const std::int64_t boot_key = query.getColumn(1).getInt64();
  const std::uint64_t seq = unsigned_id(query.getColumn(2));
  if (query.executeStep()) {
    return fail(ErrorCode::invalid, fmt::format("run {} has several markers {}; name one by its number", run, name),
                "ambiguous_marker");
  }
  query.reset();
  const auto time = time_of(database, boot_key, seq);
  if (!time) return fail(ErrorCode::invalid, fmt::format("nothing of the boot of marker {} is stored", name));
  return MarkerPlace{found.span, time->robot_time_us};
}

std::vector<Zeroing> find_zeroings(SQLite::Database& database, RunId run) {
  SQLite::Statement query{database,
                          "SELECT span, robot_time_us FROM run_span JOIN event USING (boot_key)"
                          " WHERE run_id = ? AND event_seq IS NOT NULL AND kind = 'position_zeroed'"};
  bind_all(query, run);
  std::vector<Zeroing> found;
  while (query.executeStep()) found.push_back({query.getColumn(0).getUInt(), unsigned_id(query.getColumn(1))});
  return found;
}

}  // namespace server::storage
