// A run as a SQLite file of its own, with plain rows: for programs that read SQL, without segments and keys.
//
// Tables: run, span, sample, gap, boot, clock, event, command, audit, marker, run_certificate, in_force,
// outside_reference, outside_position; columns as in the station's views (docs/database.md), ids above 2^63 as text.
// `sample` has a row per sample in order of span and seq, with t_s, gap_before, gap_after and missed_ticks_before. The
// station's views are there under their names, over these tables, and `about` explains every table, view and column.
// `audit` has the entries from the run's beginning to its end without a hole, so that the chain can be verified; of
// other robots and of accounts only the hashes. Its application_id is the station's plus 1, so no station takes it for
// its database.
//
// On the thread that owns the database handle. Throws when the disk does not take it; what it wrote is no whole file
// before advance() has returned false.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/storage/database/schema.hpp"
#include "server/storage/export/export_rows.hpp"
#include "server/storage/export/run_tables.hpp"

namespace server::storage {

inline constexpr std::int64_t kRunFileApplicationId = kApplicationId + 1;
inline constexpr std::int64_t kRunFileVersion = 3;     // its user_version
inline constexpr std::int64_t kRunFileAuditSince = 2;  // the version that brought the audit

class RunFile {
 public:
  // `path` must not exist, or be empty. `store` is the station's database as a URI for ATTACH (run_reader).
  RunFile(std::filesystem::path path, std::string store, std::vector<RecordedSpan> spans, ExportQuery query);

  // Works on for at most 20 ms; false when the file is whole. It is not synced.
  bool advance(SQLite::Database& database);

  // The last sample that was read; none: at the beginning and at the end.
  const std::optional<SampleCursor>& position() const { return after_; }

 private:
  void begin();
  bool add_samples(SQLite::Database& database);
  void add(const ExportSegment& segment);
  void bind_shared(const ExportSegment& exported);

  std::filesystem::path path_;
  std::string store_;
  std::vector<RecordedSpan> spans_;
  ExportQuery query_;
  std::unique_ptr<SQLite::Database> file_;
  std::optional<RunTables> tables_;
  std::unique_ptr<SQLite::Statement> insert_;
  std::optional<SampleCursor> after_;
  bool at_end_ = false;
  SegmentRows segments_;
};

}  // namespace server::storage
