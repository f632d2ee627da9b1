// SQL of spans and gaps; samples come from a SampleScanner.
#include "server/recording/span_reader.hpp"

#include <algorithm>
#include <iterator>
#include <map>

#include "server/recording/sample_scanner.hpp"
#include "server/recording/statement.hpp"

namespace server {
namespace {

void add_samples(const Segment& segment, const RecordedSpan& span, std::vector<StoredSample>& into) {
  for (std::size_t index = 0; index < segment.samples.size(); ++index) {
    into.push_back(stored_sample(segment, index, span.span, span.boot_id));
  }
}

// The first `wanted` samples of the span from `first_seq` on. Those that waited and have been stored since are taken
// from the database.
std::vector<StoredSample> read_samples(SampleScanner& scanner, const RecordedSpan& span, std::uint64_t first_seq,
                                       std::size_t wanted) {
  std::vector<StoredSample> stored;
  std::vector<StoredSample> waiting;
  Segment segment;
  scanner.begin(span.boot_key, {first_seq, span.samples.next});
  while (stored.size() < wanted && scanner.next(segment)) add_samples(segment, span, stored);
  scanner.end();
  for (const Segment& part : span.waiting) {
    if (part.next_seq() > first_seq) add_samples(part_of(part, {first_seq, part.next_seq()}), span, waiting);
  }
  if (waiting.empty()) {
    stored.resize(std::min(stored.size(), wanted));
    return stored;
  }
  std::vector<StoredSample> joined;
  joined.reserve(stored.size() + waiting.size());
  std::ranges::merge(stored, waiting, std::back_inserter(joined), {}, &StoredSample::seq, &StoredSample::seq);
  const auto twice = std::ranges::unique(joined, {}, &StoredSample::seq);  // leaves the stored one, which comes first
  joined.erase(twice.begin(), twice.end());
  joined.resize(std::min(joined.size(), wanted));
  return joined;
}

// Cut to the span, ascending. A gap that waited and has been stored since, perhaps with more samples, is taken from the
// database.
std::vector<Gap> read_span_gaps(SQLite::Statement& query, const RecordedSpan& span) {
  std::map<std::uint64_t, Gap> gaps;
  const std::uint64_t last_seq = span.samples.next - 1;
  const auto add = [&](std::uint64_t first, std::uint64_t last, std::string cause, std::int64_t noticed_at_us) {
    gaps.try_emplace(first, Gap{span.robot_id, span.boot_id, first, last, std::move(cause), noticed_at_us});
  };
  bind_all(query, span.boot_key, span.samples.first, last_seq);
  while (query.executeStep()) {
    add(unsigned_id(query.getColumn(0)), unsigned_id(query.getColumn(1)), query.getColumn(2).getString(),
        query.getColumn(3).getInt64());
  }
  for (const LostRange& gap : span.waiting_gaps) {
    const std::uint64_t first = std::max(gap.lost.first, span.samples.first);
    const std::uint64_t last = std::min(gap.lost.next - 1, last_seq);
    if (first <= last) add(first, last, gap.cause, gap.noticed_at_us);
  }
  std::vector<Gap> ascending;
  for (auto& [first, gap] : gaps) ascending.push_back(std::move(gap));
  return ascending;
}

}  // namespace

bool run_exists(SQLite::Database& database, RunId run) {
  SQLite::Statement query{database, "SELECT 1 FROM run WHERE run_id = ?"};
  bind_all(query, run);
  return query.executeStep();
}

std::vector<RecordedSpan> read_spans(SQLite::Database& database, RunId run, std::uint32_t first_span) {
  std::vector<RecordedSpan> spans;
  SQLite::Statement query{database,
                          "SELECT span, boot_key, boot_id, robot_id, first_seq, coalesce(last_seq, 9223372036854775806)"
                          " FROM run_span JOIN boot USING (boot_key) WHERE run_id = ? AND span >= ? ORDER BY span"};
  bind_all(query, run, first_span);
  while (query.executeStep()) {
    RecordedSpan& span = spans.emplace_back();
    span.span = query.getColumn(0).getUInt();
    span.boot_key = query.getColumn(1).getInt64();
    span.boot_id = unsigned_id(query.getColumn(2));
    span.robot_id = query.getColumn(3).getString();
    span.samples = {unsigned_id(query.getColumn(4)), unsigned_id(query.getColumn(5)) + 1};
  }
  return spans;
}

SamplePage read_page(SQLite::Database& database, const std::vector<RecordedSpan>& spans,
                     const std::optional<SampleCursor>& after, std::size_t limit) {
  SamplePage page;
  SampleScanner scanner{database, all_channels()};
  for (const RecordedSpan& span : spans) {
    const bool resumed = after && after->span == span.span;
    const std::uint64_t first_seq = resumed ? std::max(span.samples.first, after->seq + 1) : span.samples.first;
    const std::size_t wanted = limit + 1 - page.samples.size();  // one more tells whether this is the end
    const std::vector<StoredSample> samples = read_samples(scanner, span, first_seq, wanted);
    page.samples.insert(page.samples.end(), samples.begin(), samples.end());
    if (page.samples.size() > limit) break;
  }
  if (page.samples.size() > limit) {
    page.samples.pop_back();
    page.next = SampleCursor{page.samples.back().span, page.samples.back().seq};
  }
  return page;
}

std::vector<Gap> read_gaps(SQLite::Database& database, const std::vector<RecordedSpan>& spans) {
  std::vector<Gap> gaps;
  SQLite::Statement query{database,
                          "SELECT max(first_seq, ?2), min(last_seq, ?3), cause, noticed_at_us FROM gap"
                          " WHERE boot_key = ?1 AND first_seq <= ?3 AND last_seq >= ?2 ORDER BY first_seq"};
  for (const RecordedSpan& span : spans) std::ranges::move(read_span_gaps(query, span), std::back_inserter(gaps));
  return gaps;
}

}  // namespace server
