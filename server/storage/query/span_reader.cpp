// SQL of spans and gaps; samples come from a SampleScanner.
#include "server/storage/query/span_reader.hpp"

#include <algorithm>
#include <iterator>
#include <limits>
#include <map>

#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr std::size_t kAllGaps = std::numeric_limits<std::int32_t>::max();

// The waiting samples from first_seq on that are not among the stored segments.
void add_waiting(const std::vector<Segment>& waiting, std::uint64_t first_seq, std::vector<Segment>& stored) {
  if (waiting.empty()) return;
  IntervalSet known;
  for (const Segment& segment : stored) known.insert(segment.interval());
  for (const Segment& part : waiting) {
    const Interval wanted{std::max(part.first_seq, first_seq), part.next_seq()};
    for (const Interval& missing : known.missing(wanted)) stored.push_back(part_of(part, missing));
  }
  std::ranges::sort(stored, {}, &Segment::first_seq);
}

// The first `wanted` samples of the span from `first_seq` on. Those that waited and have been stored since are taken
// from the database.
std::vector<Segment> read_span_segments(SampleScanner& scanner, const RecordedSpan& span, std::uint64_t first_seq,
                                        std::size_t wanted) {
  std::vector<Segment> segments;
  std::size_t samples = 0;
  scanner.begin(span.boot_key, {first_seq, span.samples.next});
  for (Segment segment; samples < wanted && scanner.next(segment); segment = {}) {
    samples += segment.samples.size();
    segments.push_back(std::move(segment));
  }
  scanner.end();
  add_waiting(span.waiting, first_seq, segments);
  samples = 0;
  for (auto segment = segments.begin(); segment != segments.end(); ++segment) {
    samples += segment->samples.size();
    if (samples < wanted) continue;
    segment->samples.resize(segment->samples.size() - (samples - wanted));
    segments.erase(segment + 1, segments.end());
    break;
  }
  return segments;
}

// From the last gap that begins at ?2 or before: gaps do not overlap.
constexpr const char* kGaps =
    "SELECT max(first_seq, ?2), min(last_seq, ?3), cause, noticed_at_us FROM gap WHERE boot_key = ?1"
    " AND first_seq >= coalesce((SELECT max(first_seq) FROM gap WHERE boot_key = ?1 AND first_seq <= ?2), 0)"
    " AND first_seq <= ?3 AND last_seq >= ?2 ORDER BY first_seq LIMIT ?4";

// Cut to the range of the span, ascending; at most `limit`. A gap that waited and has been stored since, perhaps with
// more samples, is taken from the database.
std::vector<Gap> read_span_gaps(SQLite::Statement& query, const RecordedSpan& span, Interval range, std::size_t limit) {
  std::map<std::uint64_t, Gap> gaps;
  const std::uint64_t last_seq = range.next - 1;
  const auto add = [&](std::uint64_t first, std::uint64_t last, std::string cause, std::int64_t noticed_at_us) {
    gaps.try_emplace(first, Gap{span.span, span.robot_id, span.boot_id, first, last, std::move(cause), noticed_at_us});
  };
  bind_all(query, span.boot_key, range.first, last_seq, static_cast<std::int64_t>(limit));
  while (query.executeStep()) {
    add(unsigned_id(query.getColumn(0)), unsigned_id(query.getColumn(1)), query.getColumn(2).getString(),
        query.getColumn(3).getInt64());
  }
  for (const LostRange& gap : span.waiting_gaps) {
    const std::uint64_t first = std::max(gap.lost.first, range.first);
    const std::uint64_t last = std::min(gap.lost.next - 1, last_seq);
    if (first <= last) add(first, last, gap.cause, gap.noticed_at_us);
  }
  std::vector<Gap> ascending;
  for (auto gap = gaps.begin(); gap != gaps.end() && ascending.size() < limit; ++gap) {
    ascending.push_back(std::move(gap->second));
  }
  return ascending;
}

constexpr const char* kMade =
    " max(announced_next_seq, coalesce(ended_next_seq, 0), coalesce((SELECT last_seq + 1 FROM segment"
    " WHERE segment.boot_key = boot.boot_key ORDER BY segment.first_seq DESC LIMIT 1), 0))";

RecordedSpan span_from(SQLite::Statement& row) {
  RecordedSpan span;
  span.span = row.getColumn(0).getUInt();
  span.boot_key = row.getColumn(1).getInt64();
  span.boot_id = unsigned_id(row.getColumn(2));
  span.robot_id = row.getColumn(3).getString();
  span.samples = {unsigned_id(row.getColumn(4)), unsigned_id(row.getColumn(5)) + 1};
  span.made_next = unsigned_id(row.getColumn(6));
  span.settled_next = unsigned_id(row.getColumn(7));
  return span;
}

bool exists(SQLite::Statement query) { return query.executeStep(); }

}  // namespace

Interval RecordedSpan::made() const {
  return {samples.first, std::max(samples.first, std::min(samples.next, made_next))};
}

void RecordedSpan::cut(Interval to) {
  samples = {std::max(samples.first, to.first), std::min(samples.next, to.next)};
  samples.next = std::max(samples.first, samples.next);
  std::vector<Segment> parts;
  for (const Segment& segment : waiting) {
    const bool overlaps = segment.first_seq < samples.next && segment.next_seq() > samples.first;
    if (overlaps) parts.push_back(part_of(segment, samples));
  }
  waiting = std::move(parts);
}

bool run_exists(SQLite::Database& database, RunId run) {
  SQLite::Statement query{database, "SELECT 1 FROM run WHERE run_id = ?"};
  bind_all(query, run);
  return exists(std::move(query));
}

bool robot_exists(SQLite::Database& database, const station::RobotId& robot_id) {
  SQLite::Statement query{database, "SELECT 1 FROM robot WHERE robot_id = ?"};
  bind_all(query, robot_id);
  return exists(std::move(query));
}

std::vector<RecordedSpan> read_spans(SQLite::Database& database, RunId run, std::uint32_t first_span) {
  std::vector<RecordedSpan> spans;
  SQLite::Statement query{database, std::string{"SELECT span, boot_key, boot_id, robot_id, first_seq,"
                                                " coalesce(last_seq, 9223372036854775806), coalesce(last_seq + 1,"} +
                                        kMade +
                                        "), durable_next_seq FROM run_span JOIN boot USING (boot_key)"
                                        " WHERE run_id = ? AND span >= ? ORDER BY span"};
  bind_all(query, run, first_span);
  while (query.executeStep()) spans.push_back(span_from(query));
  return spans;
}

std::vector<RecordedSpan> read_boots(SQLite::Database& database, const station::RobotId& robot_id) {
  std::vector<RecordedSpan> spans;
  SQLite::Statement query{database, std::string{"SELECT 0, boot_key, boot_id, robot_id, 0, 9223372036854775806,"} +
                                        kMade + ", durable_next_seq FROM boot WHERE robot_id = ? ORDER BY boot_key"};
  bind_all(query, robot_id);
  while (query.executeStep()) {
    spans.push_back(span_from(query));
    spans.back().span = static_cast<std::uint32_t>(spans.size() - 1);
  }
  return spans;
}

SegmentPage read_segments(SQLite::Database& database, const std::vector<RecordedSpan>& spans,
                          const std::optional<SampleCursor>& after, std::size_t limit, Channels channels) {
  SegmentPage page;
  std::size_t wanted = limit + 1;  // one more shows whether this is the end
  SampleScanner scanner{database, channels};
  for (const RecordedSpan& span : spans) {
    if (after && span.span < after->span) continue;
    const bool resumed = after && after->span == span.span;
    const std::uint64_t first_seq = resumed ? std::max(span.samples.first, after->seq + 1) : span.samples.first;
    for (Segment& segment : read_span_segments(scanner, span, first_seq, wanted)) {
      wanted -= segment.samples.size();
      page.segments.push_back({span.span, span.boot_id, span.samples.first, span.made().next, std::move(segment)});
    }
    if (wanted == 0) break;
  }
  if (wanted > 0) return page;
  page.segments.back().segment.samples.pop_back();
  if (page.segments.back().segment.samples.empty()) page.segments.pop_back();
  const SpanSegment& last = page.segments.back();
  page.next = SampleCursor{last.span, last.segment.next_seq() - 1};
  return page;
}

SamplePage samples_of(const SegmentPage& page) {
  SamplePage samples;
  samples.next = page.next;
  for (const SpanSegment& part : page.segments) {
    for (std::size_t index = 0; index < part.segment.samples.size(); ++index) {
      samples.samples.push_back(stored_sample(part.segment, index, part.span, part.boot_id));
    }
  }
  return samples;
}

GapPage read_gaps(SQLite::Database& database, const std::vector<RecordedSpan>& spans,
                  const std::optional<SampleCursor>& after, std::size_t limit) {
  GapPage page;
  SQLite::Statement query{database, kGaps};
  for (const RecordedSpan& span : spans) {
    if (after && span.span < after->span) continue;
    Interval range = span.samples;
    if (after && after->span == span.span) range.first = std::max(range.first, after->seq + 1);
    if (range.next <= range.first) continue;
    const std::size_t wanted = limit + 1 - page.gaps.size();  // one more shows whether this is the end
    std::ranges::move(read_span_gaps(query, span, range, wanted), std::back_inserter(page.gaps));
    if (page.gaps.size() > limit) break;
  }
  if (page.gaps.size() <= limit) return page;
  page.gaps.pop_back();
  page.next = SampleCursor{page.gaps.back().span, page.gaps.back().last_seq};
  return page;
}

std::vector<MissingRange> read_missing(SQLite::Database& database, const RecordedSpan& span, Interval& left,
                                       std::size_t segments) {
  Interval range = left;
  const auto heads = read_heads(database, span.boot_key, range, {}, segments);
  if (heads.size() == segments) range.next = std::min(range.next, heads.back().next_seq);
  IntervalSet known;
  for (const SegmentHead& head : heads) known.insert({head.first_seq, head.next_seq});
  for (const Segment& segment : span.waiting) known.insert(segment.interval());
  SQLite::Statement query{database, kGaps};
  for (const Gap& gap : read_span_gaps(query, span, range, kAllGaps)) known.insert({gap.first_seq, gap.last_seq + 1});
  left.first = range.next;
  std::vector<MissingRange> missing;
  for (const Interval& hole : known.missing(range)) {
    missing.push_back({span.span, span.boot_id, hole.first, hole.next - 1});
  }
  return missing;
}

}  // namespace server::storage
