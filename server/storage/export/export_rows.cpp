// Steps through segments, and through the grid over them.
#include "server/storage/export/export_rows.hpp"

#include <algorithm>

#include "server/storage/database/schema.hpp"
#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr std::uint64_t kLongestUs = std::uint64_t{1} << 61;  // whatever number a robot says it has reached

std::uint64_t lasts_us(std::uint64_t samples, std::uint32_t period_us) {
  return period_us == 0 ? 0 : std::min(samples, kLongestUs / period_us) * period_us;
}

}  // namespace

std::uint64_t most_samples(SQLite::Database& database, const std::vector<RecordedSpan>& spans) {
  std::int64_t samples = 0;
  SQLite::Statement query{database,
                          "SELECT count(*) FROM segment WHERE boot_key = ? AND first_seq > ? AND first_seq < ?"};
  for (const RecordedSpan& span : spans) {
    bind_all(query, span.boot_key, static_cast<std::int64_t>(span.samples.first) - kMaxSegmentSamples,
             span.samples.next);
    query.executeStep();
    samples += kMaxSegmentSamples * (query.getColumn(0).getInt64() + static_cast<std::int64_t>(span.waiting.size()));
  }
  return static_cast<std::uint64_t>(samples);
}

void PagedSegments::give(SegmentPage page) {
  if (next_ < page_.segments.size()) {
    page.segments.insert(page.segments.begin(), std::move(page_.segments.back()));
  }
  page_ = std::move(page);
  next_ = 0;
}

const SpanSegment* PagedSegments::first() const {
  const std::size_t known = page_.next && !page_.segments.empty() ? page_.segments.size() - 1 : page_.segments.size();
  return next_ < known ? &page_.segments[next_] : nullptr;
}

std::uint64_t PagedSegments::gap_after() const {
  const SpanSegment& part = page_.segments[next_];
  const bool goes_on = next_ + 1 < page_.segments.size() && page_.segments[next_ + 1].span == part.span;
  return goes_on ? 0 : part.span_next_seq - std::min(part.span_next_seq, part.segment.next_seq());
}

std::optional<ExportSegment> SegmentRows::next() {
  const SpanSegment* const part = segments_.first();
  if (part == nullptr) return std::nullopt;
  const Segment& segment = part->segment;
  if (span_ != part->span) {
    next_seq_ = part->span_first_seq;
    last_.reset();
    begin_us_ = segment.first_robot_time_us;
  }
  span_ = part->span;
  const ExportSegment found{part, segment.first_seq - next_seq_, segments_.gap_after(),
                            last_ ? missed_ticks(*last_, first_tick(segment)) : 0, begin_us_};
  next_seq_ = segment.next_seq();
  last_ = last_tick(segment);
  segments_.pass();
  return found;
}

std::optional<GridRow> GridRows::next() {
  for (; const SpanSegment* const part = segments_.first(); segments_.pass()) {
    if (span_ != part->span) enter(*part);
    const Segment& segment = part->segment;
    const std::uint64_t time_us = begin_us_ + row_ * grid_us_;
    const std::uint64_t last_us = segment.robot_time_us(segment.samples.size() - 1);
    const std::uint64_t end_us = last_us + lasts_us(segments_.gap_after(), segment.context.period_us);
    if (time_us <= end_us) {
      GridRow row = time_us < segment.first_robot_time_us ? between(segment, time_us)
                    : time_us <= last_us                  ? within(segment, time_us)
                                                          : after(segment, time_us);
      row.span = part->span;
      row.since_us = static_cast<std::int64_t>(time_us - begin_us_);
      ++row_;
      return row;
    }
    leave(segment);
  }
  return std::nullopt;
}

void GridRows::enter(const SpanSegment& part) {
  span_ = part.span;
  begin_us_ = part.segment.first_robot_time_us;
  row_ = 0;
  last_.reset();
}

void GridRows::leave(const Segment& segment) {
  const std::size_t index = segment.samples.size() - 1;
  last_ = Last{segment.samples[index], segment.context, segment.robot_time_us(index), segment.utc_offset_us};
}

// Before the segment, and after the last sample before it, which there is: a span begins with a sample.
GridRow GridRows::between(const Segment& next, std::uint64_t time_us) {
  const Last& last = *last_;
  const std::uint64_t since_us = time_us - last.robot_time_us;
  const std::uint64_t until_us = next.first_robot_time_us - time_us;
  GridRow row;
  row.utc_us = static_cast<std::int64_t>(time_us) + last.utc_offset_us;
  const bool last_is_near = 2 * since_us <= last.context.period_us;
  if (2 * until_us <= next.context.period_us && !(last_is_near && since_us <= until_us)) {
    row.sample = &next.samples.front();
    row.context = &next.context;
    row.utc_us = static_cast<std::int64_t>(time_us) + next.utc_offset_us;
  } else if (last_is_near) {
    row.sample = &last.sample;
    row.context = &last.context;
  }
  return row;
}

GridRow GridRows::within(const Segment& segment, std::uint64_t time_us) {
  const std::uint64_t period_us = segment.context.period_us;
  const std::uint64_t since_us = time_us - segment.first_robot_time_us;
  std::size_t index = period_us == 0 ? 0 : since_us / period_us;
  if (period_us != 0 && 2 * (since_us % period_us) > period_us) ++index;
  GridRow row;
  row.utc_us = static_cast<std::int64_t>(time_us) + segment.utc_offset_us;
  row.sample = &segment.samples[index];
  row.context = &segment.context;
  return row;
}

// After the last sample of the span.
GridRow GridRows::after(const Segment& segment, std::uint64_t time_us) {
  GridRow row;
  row.utc_us = static_cast<std::int64_t>(time_us) + segment.utc_offset_us;
  const std::size_t last = segment.samples.size() - 1;
  if (2 * (time_us - segment.robot_time_us(last)) > segment.context.period_us) return row;
  row.sample = &segment.samples[last];
  row.context = &segment.context;
  return row;
}

}  // namespace server::storage
