// Groups, segments' heads, or rows, gathered into points.
#include "server/storage/query/overview.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr std::size_t kSliceSamples = 20'000;
constexpr std::size_t kSliceHeads = 5'000;
constexpr std::uint64_t kSegmentSamples = 100;  // at most
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// The point of a place, and the first place of a point; with room for whatever number a robot says it has reached.
std::uint64_t point_of(std::uint64_t place, std::uint64_t points, std::uint64_t places) {
  return static_cast<std::uint64_t>(static_cast<unsigned __int128>(place) * points / places);
}
std::uint64_t place_of(std::uint64_t point, std::uint64_t points, std::uint64_t places) {
  return static_cast<std::uint64_t>((static_cast<unsigned __int128>(point) * places + points - 1) / points);
}

std::int64_t utc_us(const Segment& segment, std::size_t index) {
  return static_cast<std::int64_t>(segment.robot_time_us(index)) + segment.utc_offset_us;
}

// The samples [begin, end) of the segment. fmin and fmax pass over NaN.
Extent extent_of(const Segment& segment, std::size_t begin, std::size_t end, OverviewChannels channels) {
  Extent extent;
  extent.numbers = {segment.first_seq + begin, segment.first_seq + end};
  extent.samples = end - begin;
  extent.first_utc_us = utc_us(segment, begin);
  extent.last_utc_us = utc_us(segment, end - 1);
  extent.min.fill(kNaN);
  extent.max.fill(kNaN);
  for (std::size_t channel = 0; channel < kOverviewChannels; ++channel) {
    if (!channels[channel]) continue;
    for (std::size_t index = begin; index < end; ++index) {
      const float value = overview_value(channel, segment.samples[index], segment.context);
      extent.min[channel] = std::fmin(extent.min[channel], value);
      extent.max[channel] = std::fmax(extent.max[channel], value);
    }
  }
  return extent;
}

Extent extent_of(const Segment& segment, OverviewChannels channels) {
  return extent_of(segment, 0, segment.samples.size(), channels);
}

// Of the stored segments in the range; one that reaches beyond it is cut, for which its rows are read.
std::vector<Extent> read_extents(SQLite::Database& database, const RecordedSpan& span, Interval range,
                                 OverviewChannels channels) {
  std::vector<Extent> extents;
  for (const SegmentHead& head : read_heads(database, span.boot_key, range, channels, kSliceHeads)) {
    if (head.first_seq >= range.first && head.next_seq <= range.next) {
      extents.push_back(extent_of(head));
      continue;
    }
    SampleScanner scanner{database, sample_channels(channels)};
    scanner.begin(span.boot_key, {std::max(head.first_seq, range.first), std::min(head.next_seq, range.next)});
    Segment segment;
    if (scanner.next(segment)) extents.push_back(extent_of(segment, channels));
  }
  return extents;
}

// The waiting samples of the range that are not among the stored ones.
void add_waiting(const RecordedSpan& span, Interval range, OverviewChannels channels, std::vector<Extent>& extents) {
  if (span.waiting.empty()) return;
  IntervalSet stored;
  for (const Extent& extent : extents) stored.insert(extent.numbers);
  for (const Segment& segment : span.waiting) {
    const Interval part{std::max(segment.first_seq, range.first), std::min(segment.next_seq(), range.next)};
    for (const Interval& missing : stored.missing(part)) {
      extents.push_back(extent_of(part_of(segment, missing), channels));
    }
  }
  std::ranges::sort(extents, {}, [](const Extent& extent) { return extent.numbers.first; });
}

// How many segments the span has, at most `limit`; from the index alone.
std::size_t count_segments(SQLite::Database& database, const RecordedSpan& span, std::size_t limit) {
  SQLite::Statement query{database,
                          "SELECT count(*) FROM (SELECT 1 FROM segment WHERE boot_key = ? AND first_seq >= ? AND"
                          " first_seq < ? LIMIT ?)"};
  bind_all(query, span.boot_key, span.samples.first, span.samples.next, static_cast<std::int64_t>(limit));
  query.executeStep();
  return static_cast<std::size_t>(query.getColumn(0).getInt64()) + span.waiting.size();
}

}  // namespace

OverviewScan::OverviewScan(std::vector<RecordedSpan> spans, OverviewQuery query)
    : spans_{std::move(spans)}, query_{query} {
  for (RecordedSpan& span : spans_) {
    span.cut(span.made());
    first_place_.push_back(places_);
    places_ += span.samples.next - span.samples.first;
  }
  if (!spans_.empty()) next_seq_ = spans_.front().samples.first;
}

bool OverviewScan::advance(SQLite::Database& database) {
  if (places_ == 0) return false;
  if (!chosen_) choose(database);
  return columns_.from_segments ? advance_segments(database) : advance_rows(database);
}

void OverviewScan::choose(SQLite::Database& database) {
  chosen_ = true;
  const std::size_t enough = (query_.points * 2 + 4) / 5;  // 0.4 of the points
  by_groups_ = places_ / kGroupNumbers >= enough;
  std::size_t segments = 0;
  if (places_ / kSegmentSamples < query_.points) {
    for (const RecordedSpan& span : spans_) {
      segments += count_segments(database, span, enough);
      if (segments >= enough) break;
    }
  }
  columns_.from_segments = places_ / kSegmentSamples >= query_.points || segments >= enough;
}

bool OverviewScan::advance_rows(SQLite::Database& database) {
  const SegmentPage page = read_segments(database, spans_, after_, kSliceSamples, sample_channels(query_.channels));
  for (const SpanSegment& part : page.segments) {
    const auto same = [&part](const RecordedSpan& span) { return span.span == part.span; };
    add_rows(static_cast<std::size_t>(std::ranges::find_if(spans_, same) - spans_.begin()), part.segment);
  }
  after_ = page.next;
  return after_.has_value();
}

void OverviewScan::add_rows(std::size_t span, const Segment& segment) {
  const std::uint64_t first_place = first_place_[span] + segment.first_seq - spans_[span].samples.first;
  for (std::size_t begin = 0; begin < segment.samples.size();) {
    const std::uint64_t point = point_of(first_place + begin, query_.points, places_);
    const std::uint64_t next_place = place_of(point + 1, query_.points, places_);
    const std::size_t end = std::min<std::size_t>(segment.samples.size(), next_place - first_place);
    add(first_place + begin, extent_of(segment, begin, end, query_.channels));
    begin = end;
  }
}

// What is stored of the next piece of the range, which is cut to it: a run of groups, or the segments up to the next
// one.
std::vector<Extent> OverviewScan::read_next(SQLite::Database& database, Interval& range) {
  const SQLite::Transaction moment{database};  // nothing is purged between a group or a head and its rows
  const RecordedSpan& span = spans_[span_];
  if (by_groups_) {
    GroupRun run = read_groups(database, span.boot_key, range, query_.channels, kSliceHeads);
    range.next = run.groups.empty() ? run.next_group : run.groups.back().numbers.next;
    if (!run.groups.empty()) return std::move(run.groups);
  }
  std::vector<Extent> extents = read_extents(database, span, range, query_.channels);
  if (extents.size() == kSliceHeads) range.next = extents.back().numbers.next;
  return extents;
}

bool OverviewScan::advance_segments(SQLite::Database& database) {
  const RecordedSpan& span = spans_[span_];
  Interval range{next_seq_, span.samples.next};
  std::vector<Extent> extents = read_next(database, range);
  add_waiting(span, range, query_.channels, extents);
  for (const Extent& extent : extents) add(first_place_[span_] + extent.numbers.first - span.samples.first, extent);
  next_seq_ = range.next;
  while (span_ < spans_.size() && next_seq_ >= spans_[span_].samples.next) {
    if (++span_ < spans_.size()) next_seq_ = spans_[span_].samples.first;
  }
  return span_ < spans_.size();
}

void OverviewScan::add(std::uint64_t place, const Extent& extent) {
  const std::uint64_t point = point_of(place, query_.points, places_);
  const bool begins = point_ != point;
  point_ = point;
  if (begins) {
    columns_.first_utc_us.push_back(extent.first_utc_us);
    columns_.last_utc_us.emplace_back();
    columns_.samples.emplace_back();
  }
  columns_.last_utc_us.back() = extent.last_utc_us;
  columns_.samples.back() += extent.samples;
  for (std::size_t channel = 0; channel < kOverviewChannels; ++channel) {
    if (!query_.channels[channel]) continue;
    std::vector<float>& min = columns_.min[channel];
    std::vector<float>& max = columns_.max[channel];
    if (begins) {
      min.push_back(kNaN);
      max.push_back(kNaN);
    }
    min.back() = std::fmin(min.back(), extent.min[channel]);
    max.back() = std::fmax(max.back(), extent.max[channel]);
  }
}

}  // namespace server::storage
