// A run as CSV: a header line with units in the names, then a line per sample, or per step of a uniform grid.
//
//   span,boot_id,seq,robot_time_us,t_s,utc,<channels>,<the first four of kBatchFields>,clock_uncertainty_us,
//   first_received_at_us,received_at_us,<the others>,gap_before,gap_after,unknown_values,
//   missed_ticks_before
//   span,t_s,utc,<channels>,setpoint_m,mode,gap                                                           (grid)
//
// Numbers are the shortest decimals that give the same binary32 back; what is no finite number is an empty field. utc
// is RFC 3339. gap_before: samples missing right before this one; gap_after: after it, to the end of its span. gap: 1
// where there is no sample. missed_ticks_before: ticks at which the robot made no sample, right before this one. t_s:
// seconds since the first sample of the span, on the robot's clock. On the thread that owns the database handle.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <optional>
#include <string>
#include <vector>

#include "server/storage/export/export_rows.hpp"

namespace server::storage {

// "2026-03-01T12:00:00.000001Z". Remembers the second, which many have in common.
class UtcText {
 public:
  void append(std::string& out, std::int64_t utc_us);

 private:
  std::int64_t second_ = -1;
  std::string beginning_;  // up to the point
};

class CsvWriter {
 public:
  // The spans as they were when the export began.
  CsvWriter(std::vector<RecordedSpan> spans, ExportQuery query);

  // The next lines, some 400 kB at most; none at the end. Takes at most 20 ms. The text may be empty.
  std::optional<std::string> next(SQLite::Database& database);

  // The last sample that was read; none: at the beginning and at the end.
  const std::optional<SampleCursor>& position() const { return after_; }

 private:
  std::string header() const;
  void append_rows(std::string& out);
  void append(std::string& out, const ExportSegment& segment);
  void append(std::string& out, const GridRow& row);
  std::string shared_text(const Segment& segment) const;

  std::vector<RecordedSpan> spans_;
  ExportQuery query_;
  std::optional<SampleCursor> after_;
  bool begun_ = false;
  bool at_end_ = false;
  SegmentRows segments_;
  std::optional<GridRows> grid_;
  UtcText utc_;
};

}  // namespace server::storage
