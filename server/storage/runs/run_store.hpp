// What changes runs in the database: begin, end, interrupt, make afterwards, annotate, discard.
//
// Disk thread only; each call but end() is one transaction, with its entries in the audit. Uses the Database, which
// outlives it. An open run has exactly one open span; BootStore::start moves it to a new boot.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/runtime/result.hpp"
#include "server/station/state/audit_note.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/runs/run_queries.hpp"
#include "server/storage/runs/run_spans.hpp"

namespace server::storage {

// Where and how a run ends.
struct RunEnd {
  station::BootId boot_id = 0;
  std::uint64_t next_seq = 0;  // of that boot, one above the run's last sample
  std::string verdict;         // empty: the one it has
  std::string station_document;
  station::Author by;
};

class RunStore {
 public:
  explicit RunStore(Database& database) : handle_{database.handle()} {}

  // Stores a run with its one open span. not_connected when that boot has ended meanwhile. The station's document, if
  // there is one, is noted as in force in its spans, here and in end().
  Result<RunId> add(const Run& run, const std::string& station_document, const station::Author& by);

  // The same of what is recorded, and was found before. Nothing when a boot of which samples were found has none any
  // more: they have been purged meanwhile.
  std::optional<RunId> add_afterwards(Run run, const RecordedSamples& samples, const station::Author& by);

  // Both: not_found, and conflict for a discarded (annotate) or open (discard) run.
  Result<void> annotate(RunId id, const RunAnnotation& annotation, const station::Author& by);
  Result<void> discard(RunId id, const std::string& reason, const station::Author& by);

  // Closes the run and its span of that boot (a span without samples is dropped); what reboots have begun since then is
  // no part of it. The caller's transaction.
  void end(RunId id, const RunEnd& end);

  // Closes every open run at the last sample known of its open span. Returns which they were.
  std::vector<RunId> interrupt(std::int64_t utc_us);

 private:
  RunId insert(const Run& run);
  void note_in_audit(RunId id, const station::RobotId& robot_id, const char* action, const nlohmann::json& detail,
                     const station::Author& by);
  void add_note(RunId id, const station::Author& author, const std::string& field, const std::string& before,
                const std::string& after);
  void put_in_force(RunId id, const std::string& station_document, std::int64_t utc_us);
  void close_open_span(RunId id);
  void close_span(RunId id, std::int64_t span, std::int64_t boot_key, std::uint64_t next_seq);

  SQLite::Database& handle_;
};

station::RobotId robot_of(SQLite::Database& database, RunId run);  // empty: there is no such run

}  // namespace server::storage
