// The rows of an export, in order of span and seq: every sample with the number of samples missing before it, and at
// the end of a span after it; or a uniform grid of time.
//
// Grid: from the first sample of each span to its end, a row each `grid_us` of robot time. A row has the nearest sample
// within half of that sample's period (of two as near the earlier one), else nothing: it is a gap. Nothing is
// interpolated, and no clock's step bends the grid. Samples that are missing at the end of a span are reckoned with the
// period of the last one.
//
// The rows work page by page, so memory does not grow with the length of the run; they know no database and no thread.
#pragma once

#include <cstdint>
#include <optional>

#include "server/storage/query/span_reader.hpp"

namespace server::storage {

struct ExportQuery {
  RunId run = 0;
  Channels channels = all_channels();
  std::optional<std::int64_t> grid_us;  // none: every sample
};

// Samples that share everything but their values, as an export writes them.
struct ExportSegment {
  const SpanSegment* part = nullptr;
  std::uint64_t gap_before = 0;     // samples that are missing right before the first of them
  std::uint64_t gap_after = 0;      // and after the last of them, to the end of the span
  std::uint64_t missed_before = 0;  // ticks that the robot missed right before the first of them
  std::uint64_t begin_us = 0;       // robot time of the first sample of the span, from which t_s counts

  std::int64_t since_us(std::uint64_t robot_time_us) const {
    return static_cast<std::int64_t>(robot_time_us - begin_us);
  }
};

struct GridRow {
  std::uint32_t span = 0;
  std::int64_t since_us = 0;                        // since the first sample of the span
  std::int64_t utc_us = 0;                          // in a gap by the clock of the sample before it
  const station::Sample* sample = nullptr;          // null: a gap
  const station::SampleContext* context = nullptr;  // of the sample
};

// t_s, as binary64: exported like this by every format that has numbers.
inline double seconds(std::int64_t time_us) { return static_cast<double>(time_us) / 1e6; }

// At least as many samples as the spans hold, from the index alone.
std::uint64_t most_samples(SQLite::Database& database, const std::vector<RecordedSpan>& spans);

// Segments from page to page. The last one of a page is held back until the next page shows whether its span continues.
class PagedSegments {
 public:
  void give(SegmentPage page);       // the page after the one before
  const SpanSegment* first() const;  // null: the next page, please
  void pass() { ++next_; }           // by the first
  // Samples that are missing after the first segment, if it is the last one of its span.
  std::uint64_t gap_after() const;

 private:
  SegmentPage page_;
  std::size_t next_ = 0;
};

class SegmentRows {
 public:
  void give(SegmentPage page) { segments_.give(std::move(page)); }
  std::optional<ExportSegment> next();  // none: the next page, please; valid until it is given

 private:
  PagedSegments segments_;
  std::optional<std::uint32_t> span_;
  std::uint64_t next_seq_ = 0;
  std::optional<Tick> last_;    // of the segment before, if it is of the span
  std::uint64_t begin_us_ = 0;  // of the span, robot time
};

class GridRows {
 public:
  explicit GridRows(std::int64_t grid_us) : grid_us_{static_cast<std::uint64_t>(grid_us)} {}

  void give(SegmentPage page) { segments_.give(std::move(page)); }
  std::optional<GridRow> next();  // valid until the next call

 private:
  // One sample, and what places it.
  struct Last {
    station::Sample sample;
    station::SampleContext context;
    std::uint64_t robot_time_us = 0;
    std::int64_t utc_offset_us = 0;
  };

  void enter(const SpanSegment& part);
  void leave(const Segment& segment);
  GridRow between(const Segment& next, std::uint64_t time_us);
  GridRow within(const Segment& segment, std::uint64_t time_us);
  GridRow after(const Segment& segment, std::uint64_t time_us);

  std::uint64_t grid_us_;
  PagedSegments segments_;
  std::optional<std::uint32_t> span_;
  std::uint64_t begin_us_ = 0;  // of the span, robot time
  std::uint64_t row_ = 0;       // of the span
  std::optional<Last> last_;    // of the segment before
};

}  // namespace server::storage
