// Finds the part of spans that lies in a window of time.
//
// The ends are looked for with BootTimes. Where they fall into a gap they are reckoned with the period of the segment
// before it. The station's clock may have been set back within a boot: the window then ends at one of the places that
// bear its time, and everything between its two ends belongs to it.
//
// On the thread that owns the database handle.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <span>
#include <vector>

#include "server/storage/query/span_reader.hpp"

namespace server::storage {

// [from_us, to_us), UTC
struct TimeWindow {
  std::int64_t from_us = 0;
  std::int64_t to_us = 0;
};

// Cuts the spans to the window and drops those that were not made within it. A span of which nothing is known but its
// gaps has no time and is dropped, too. What is found is moved out of `spans`.
std::vector<RecordedSpan> cut_to_window(SQLite::Database& database, std::span<RecordedSpan> spans, TimeWindow window);

}  // namespace server::storage
