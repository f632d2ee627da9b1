// Reads pages of samples, and gaps, of the spans of a run, and joins what the recorder had not stored yet.
//
// On the thread that owns the database handle; each call is a few statements and ends within a page.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/recording/runs.hpp"
#include "server/recording/segment.hpp"
#include "server/recording/stored_sample.hpp"

namespace server {

// Where a page ended: the span and seq of its last sample. A page begins after it.
struct SampleCursor {
  std::uint32_t span = 0;
  std::uint64_t seq = 0;
};

struct SamplePage {
  std::vector<StoredSample> samples;
  std::optional<SampleCursor> next;  // empty: the end
};

struct Gap {
  RobotId robot_id;
  BootId boot_id = 0;
  std::uint64_t first_seq = 0;
  std::uint64_t last_seq = 0;
  std::string cause;
  std::int64_t noticed_at_us = 0;
};

// One span of a run, and what of it was not durable when the question came.
struct RecordedSpan {
  std::uint32_t span = 0;
  std::int64_t boot_key = 0;
  BootId boot_id = 0;
  RobotId robot_id;
  Interval samples;  // up to the largest number there is while the span is open
  std::vector<Segment> waiting;
  std::vector<LostRange> waiting_gaps;
};

bool run_exists(SQLite::Database& database, RunId run);

// From this index on, with nothing waiting.
std::vector<RecordedSpan> read_spans(SQLite::Database& database, RunId run, std::uint32_t first_span);

// At most `limit` samples after the cursor, in order of span and seq.
SamplePage read_page(SQLite::Database& database, const std::vector<RecordedSpan>& spans,
                     const std::optional<SampleCursor>& after, std::size_t limit);

// Cut to the spans, in order of span and seq.
std::vector<Gap> read_gaps(SQLite::Database& database, const std::vector<RecordedSpan>& spans);

}  // namespace server
