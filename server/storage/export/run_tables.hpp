// What a station's database has of a run beside its samples, as tables of another database: run, span, boot, clock,
// event, command, audit, marker, run_certificate, in_force, outside_reference, outside_position, and gap.
//
// The columns are those of the station's views (docs/database.md), so that what other parts add to a run comes with it.
//
// On the thread that owns the handles. Throws when the disk does not take it.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/storage/query/span_reader.hpp"

namespace server::storage {

class RunTables {
 public:
  // Into `file`, which outlives this and has no such tables. `store` is the station's database as a URI for ATTACH.
  RunTables(SQLite::Database& file, const std::string& store, RunId run);

  // Works on for at most 20 ms; false when everything is there. `database` is the station's, for the gaps.
  bool advance(SQLite::Database& database, const std::vector<RecordedSpan>& spans);

 private:
  void copy_some();
  bool reference_is_whole();
  void copy_reference_again();
  bool add_gaps(SQLite::Database& database, const std::vector<RecordedSpan>& spans);

  SQLite::Database& file_;
  RunId run_;
  std::size_t copied_ = 0;  // tables
  int reference_tries_ = 0;
  std::int64_t piece_after_ = 0;  // of the table that is copied: where the next piece begins
  std::optional<SampleCursor> gaps_after_;
};

}  // namespace server::storage
