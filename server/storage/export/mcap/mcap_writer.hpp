// A run as an MCAP file, for Foxglove and everything else that reads MCAP: messages in JSON, with a JSON Schema each.
//
//   /telemetry  a message per sample: span, boot_id, seq, robot_time_us, t_s, utc_us, the channels, the fields of its
//               batch, clock_uncertainty_us, first_received_at_us, received_at_us, gap_before, gap_after,
//               missed_ticks_before, unknown_values
//   /event  /command  /gap  /marker   the rows of the tables of the SQLite export (run_tables.hpp)
//
// Names and values are those of the SQLite export; a value that is none there is left out. A number of a sample is the
// shortest decimal that gives the same binary32 back. Log time is UTC: of a sample utc_us, of an event received_at_us,
// of a command submitted_at_us, of a gap noticed_at_us, of a marker made_at_us. Publish time is the robot's time since
// boot of a sample and of an event that has one, else the log time. The sequence is seq, or counts a channel's
// messages. The metadata record `rheonaut.run` has what is said of the run and its digest (run_facts.hpp).
//
// On the thread that owns the database handle. Throws when the disk does not take it.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/storage/export/export_rows.hpp"
#include "server/storage/export/mcap/mcap_file.hpp"
#include "server/storage/export/mcap/table_messages.hpp"
#include "server/storage/export/run_tables.hpp"

namespace server::storage {

class McapWriter {
 public:
  // `store` is the station's database as a URI for ATTACH (run_reader).
  McapWriter(const std::filesystem::path& path, const std::string& store, std::vector<RecordedSpan> spans,
             ExportQuery query);

  // Works on for at most 20 ms; false when the file is whole. It is not synced.
  bool advance(SQLite::Database& database);

  // The last sample that was read; none: at the beginning and at the end.
  const std::optional<SampleCursor>& position() const { return after_; }

 private:
  bool write_tables();
  bool write_samples(SQLite::Database& database);
  void write(const ExportSegment& segment);

  McapFile file_;
  std::vector<RecordedSpan> spans_;
  ExportQuery query_;
  std::unique_ptr<SQLite::Database> beside_;  // the run's other tables
  std::optional<RunTables> copy_;             // of them, until they are there
  std::optional<TableMessages> table_;        // that is written
  std::size_t tables_written_ = 0;
  ChannelId telemetry_ = 0;
  std::optional<SampleCursor> after_;
  bool at_end_ = false;
  SegmentRows segments_;
};

}  // namespace server::storage
