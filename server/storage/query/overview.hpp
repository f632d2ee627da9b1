// An overview of a recording: for each of at most N points, how many samples it stands for, from when to when, and the
// least and the largest value of each channel among them.
//
// A sample's place is its number in the spans, laid end to end; a point is an equal share of the places. No sample is
// in two points and none is left out; a share in which nothing is stored gives no point. Points follow one another by
// span and number, never by UTC, which steps when a clock is set.
//
// Segments keep their extremes, so an overview of many samples reads no rows: where a point is at least a segment long
// (100 samples), or 0.4 N segments are there, each segment goes whole to the point of its first sample. Where 0.4 N
// groups of segments (6400 samples each) fit into the spans, groups take their place, and only what has no group is
// read by segments. Otherwise rows are read, at most 40 N. Either way the extremes are exact for the samples that the
// point says it stands for.
//
// On the thread that owns the database handle.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "server/storage/groups/segment_groups.hpp"
#include "server/storage/query/span_reader.hpp"

namespace server::storage {

struct OverviewQuery {
  std::size_t points = 2000;  // at least 1
  OverviewChannels channels = overview_channels(all_channels());
};

// A row per point.
struct OverviewColumns {
  bool from_segments = false;
  std::vector<std::int64_t> first_utc_us;  // of its first sample
  std::vector<std::int64_t> last_utc_us;   // of its last one
  std::vector<std::uint64_t> samples;
  std::array<std::vector<float>, kOverviewChannels> min;  // NaN: no finite value; empty unless asked for
  std::array<std::vector<float>, kOverviewChannels> max;
};

// Makes an overview piece by piece.
class OverviewScan {
 public:
  OverviewScan(std::vector<RecordedSpan> spans, OverviewQuery query);

  // Reads at most 20 ms more; false when everything is read.
  bool advance(SQLite::Database& database);

  OverviewColumns take() { return std::move(columns_); }

 private:
  void choose(SQLite::Database& database);
  bool advance_rows(SQLite::Database& database);
  bool advance_segments(SQLite::Database& database);
  std::vector<Extent> read_next(SQLite::Database& database, Interval& range);
  void add_rows(std::size_t span, const Segment& segment);
  void add(std::uint64_t place, const Extent& extent);

  std::vector<RecordedSpan> spans_;  // cut to what was made
  OverviewQuery query_;
  std::vector<std::uint64_t> first_place_;  // of each span
  std::uint64_t places_ = 0;
  bool chosen_ = false;
  bool by_groups_ = false;
  std::optional<SampleCursor> after_;  // rows: where to go on
  std::size_t span_ = 0;               // segments: where to go on
  std::uint64_t next_seq_ = 0;
  std::optional<std::uint64_t> point_;  // the share that the last row is of
  OverviewColumns columns_;
};

}  // namespace server::storage
