// Reads the stored samples of a boot a segment at a time, and the heads of its segments: under every query, export and
// check that reads many samples.
//
// On the thread that owns the database handle: a reader's, or the disk thread. Prepares its statements once and keeps
// them; no text is parsed per row. Reads every version of the schema: what
// a version does not have is NULL there. Between begin() and the end of the samples
// (or end()) it holds a read transaction on the handle, so a caller that stops early calls end().
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "server/storage/database/statement.hpp"
#include "server/storage/samples/channels.hpp"
#include "server/storage/samples/segment.hpp"

namespace server::storage {

class SampleScanner {
 public:
  // Channels that are not asked for are NaN.
  SampleScanner(SQLite::Database& database, Channels channels);

  // The stored samples of the boot in the range, ascending. Also in the middle of an earlier scan, which it ends.
  void begin(std::int64_t boot_key, Interval samples);

  // The next segment, cut to the range; false at the end. Throws when a row is missing: the database is damaged.
  bool next(Segment& into);

  // Lets go of the read transaction.
  void end();

 private:
  // The number of an enumerator's text, which is looked up only when the text is another one than last time.
  struct Named {
    std::string name = "?";  // no enumerator's
    std::int32_t number = 0;
  };

  // Returns its first row; the samples' number is right, their values are not.
  std::int64_t read_segment(Segment& into);
  void read_context(station::SampleContext& into);
  void read_rows(std::int64_t first_row, Segment& into);
  void seek(std::int64_t row);

  SQLite::Database& database_;
  Channels channels_;
  RawStatement segments_;
  RawStatement rows_;
  Interval range_;
  std::int64_t boot_key_ = 0;
  std::int64_t next_row_ = 0;  // that rows_ gives at its next step; 0: it must seek
  bool scanning_ = false;
  std::array<Named, station::kBatchFieldCount> last_texts_;  // by row of kBatchFields
};

// What is known of a segment without its rows.
struct SegmentHead {
  std::uint64_t first_seq = 0;
  std::uint64_t next_seq = 0;
  std::uint64_t first_robot_time_us = 0;
  std::uint32_t period_us = 0;
  std::int64_t utc_offset_us = 0;
  std::int64_t clock_uncertainty_us = -1;
  std::array<float, kOverviewChannels> min{};  // by overview_index; NaN: no finite value, or not asked for
  std::array<float, kOverviewChannels> max{};
  std::uint32_t flags = 0;  // TelemetryFlag
};

// The heads of the segments that have a sample in the range, ascending and not cut to it; the first `limit` of them.
std::vector<SegmentHead> read_heads(SQLite::Database& database, std::int64_t boot_key, Interval samples,
                                    OverviewChannels channels,
                                    std::size_t limit = std::numeric_limits<std::int32_t>::max());

}  // namespace server::storage
