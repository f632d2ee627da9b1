// Reads the spans of a run or of a robot: their samples page by page, their gaps, what is still missing; and joins what
// the recorder had not stored yet.
//
// On the thread that owns the database handle; each call is a few statements and ends within a page.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/storage/runs/run.hpp"
#include "server/storage/samples/sample_scanner.hpp"
#include "server/storage/samples/segment.hpp"
#include "server/storage/samples/stored_sample.hpp"

namespace server::storage {

// Where a page ended: the span and seq of its last sample. A page begins after it.
struct SampleCursor {
  std::uint32_t span = 0;
  std::uint64_t seq = 0;
};

struct SamplePage {
  std::vector<StoredSample> samples;
  std::optional<SampleCursor> next;  // empty: the end
};

struct SpanSegment {
  std::uint32_t span = 0;
  station::BootId boot_id = 0;
  std::uint64_t span_first_seq = 0;
  std::uint64_t span_next_seq = 0;  // the end of what was made of the span
  Segment segment;                  // cut to the span
};

struct SegmentPage {
  std::vector<SpanSegment> segments;
  std::optional<SampleCursor> next;  // empty: the end
};

struct Gap {
  std::uint32_t span = 0;
  station::RobotId robot_id;
  station::BootId boot_id = 0;
  std::uint64_t first_seq = 0;
  std::uint64_t last_seq = 0;
  std::string cause;
  std::int64_t noticed_at_us = 0;
};

struct GapPage {
  std::vector<Gap> gaps;
  std::optional<SampleCursor> next;  // the end of the last of them; empty: there are no more
};

// Samples that are neither stored nor lost: still on their way, if the robot comes back with them.
struct MissingRange {
  std::uint32_t span = 0;
  station::BootId boot_id = 0;
  std::uint64_t first_seq = 0;
  std::uint64_t last_seq = 0;
};

// Consecutive samples of a boot, and what of them was not durable when the question came.
struct RecordedSpan {
  std::uint32_t span = 0;  // index of the run's span, or of the robot's boot
  std::int64_t boot_key = 0;
  station::BootId boot_id = 0;
  station::RobotId robot_id;
  Interval samples;                // up to the largest number there is while the span is open
  std::uint64_t made_next = 0;     // every sample of the span below was made
  std::uint64_t settled_next = 0;  // every sample below is stored or lost for good; 0: not known
  std::vector<Segment> waiting;
  std::vector<LostRange> waiting_gaps;

  // The part of the span that is known to have been made.
  Interval made() const;
  // Narrows the span and what waits of it.
  void cut(Interval to);
};

bool run_exists(SQLite::Database& database, RunId run);
bool robot_exists(SQLite::Database& database, const station::RobotId& robot_id);

// From this index on, with nothing waiting.
std::vector<RecordedSpan> read_spans(SQLite::Database& database, RunId run, std::uint32_t first_span);
// One for each boot of the robot, in the order in which they were first seen; with nothing waiting.
std::vector<RecordedSpan> read_boots(SQLite::Database& database, const station::RobotId& robot_id);

// At most `limit` samples after the cursor, in order of span and seq.
SegmentPage read_segments(SQLite::Database& database, const std::vector<RecordedSpan>& spans,
                          const std::optional<SampleCursor>& after, std::size_t limit, Channels channels);

// Sample by sample.
SamplePage samples_of(const SegmentPage& page);

// Cut to the spans, in order of span and seq; at most `limit`, of the samples after the cursor.
GapPage read_gaps(SQLite::Database& database, const std::vector<RecordedSpan>& spans,
                  const std::optional<SampleCursor>& after, std::size_t limit);

// What of these samples of the span, which were made, is neither stored nor lost, as far as `segments` stored segments
// reach; `left` becomes what the next call goes on with.
std::vector<MissingRange> read_missing(SQLite::Database& database, const RecordedSpan& span, Interval& left,
                                       std::size_t segments);

}  // namespace server::storage
