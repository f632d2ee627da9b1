// A run as a MAT file of version 5, for MATLAB and Octave: a struct `info` with what is said of the run, and a column
// vector for each quantity, named as in the CSV.
//
// Channels and numbers of a batch (telemetry_fields.hpp) are single and NaN where there is no number; times, seq,
// gap_before, gap_after and missed_ticks_before are double, which holds them exactly; span, enumerators and counts are
// uint32, ids uint64. Enumerators are the numbers of the protocol, also those that this version does not know
// (info.modes spells out those of mode), and beside each its texts as a matrix of characters: mode_text for mode.
// info.boot_ids has the boots of the spans as uint64. On a grid: span, t_s, utc_us, the channels, setpoint_m, mode,
// mode_text and gap; 0 and blanks in a gap.
//
// On the thread that owns the database handle; no other thread may use matio meanwhile. Errors: invalid when a column
// would have more than 2 GiB, which the format does not hold. Throws when the disk does not take it.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/runtime/result.hpp"
#include "server/storage/export/export_rows.hpp"
#include "server/storage/export/mat/mat_column.hpp"

namespace server::storage {

class MatWriter {
 public:
  // Columns grow beside the file.
  MatWriter(std::filesystem::path path, std::vector<RecordedSpan> spans, ExportQuery query);
  ~MatWriter();
  MatWriter(const MatWriter&) = delete;
  MatWriter& operator=(const MatWriter&) = delete;

  // Works on for at most 20 ms; false when the file is whole. It is not synced.
  Result<bool> advance(SQLite::Database& database);

  // The last sample that was read; none: at the beginning and at the end.
  const std::optional<SampleCursor>& position() const { return after_; }

 private:
  void add_columns();
  void write_facts(SQLite::Database& database);
  void push(const ExportSegment& segment);
  void push(const GridRow& row);
  bool push_rows();
  bool copy_columns();

  std::filesystem::path path_;
  std::vector<RecordedSpan> spans_;
  ExportQuery query_;
  std::vector<MatColumn> columns_;  // in the order in which they are pushed
  std::optional<SampleCursor> after_;
  bool begun_ = false;
  bool at_end_ = false;
  SegmentRows segments_;
  std::optional<GridRows> grid_;
  std::size_t copied_ = 0;  // columns
  int file_ = -1;
};

}  // namespace server::storage
