// Reads digests from the database and writes them.
#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <tuple>

#include "server/storage/database/statement.hpp"
#include "server/storage/runs/run_digest.hpp"
#include "server/storage/samples/sample_scanner.hpp"

namespace server::storage {
namespace {

constexpr std::uint64_t kTalliedSamples = 1'000'000;  // whose heads are read at once
constexpr int kColumnsBeforeSchema12 = 13;

struct Lost {
  Interval samples;
  std::string cause;
};

// Cut to the range, ascending.
std::vector<Lost> read_lost(SQLite::Database& database, std::int64_t boot_key, Interval range) {
  std::vector<Lost> lost;
  SQLite::Statement query{database,
                          "SELECT max(first_seq, ?2), min(last_seq, ?3), cause FROM gap"
                          " WHERE boot_key = ?1 AND first_seq <= ?3 AND last_seq >= ?2 ORDER BY first_seq"};
  bind_all(query, boot_key, range.first, range.next - 1);
  while (query.executeStep()) {
    lost.push_back(
        {{unsigned_id(query.getColumn(0)), unsigned_id(query.getColumn(1)) + 1}, query.getColumn(2).getString()});
  }
  return lost;
}

SampleTally::Stretch stretch(const Segment& segment) {
  return {.samples = segment.interval(),
          .first_robot_time_us = segment.first_robot_time_us,
          .period_us = segment.context.period_us,
          .flags = segment.context.flags,
          .clock_uncertainty_us = segment.clock_uncertainty_us};
}

SampleTally::Stretch stretch(const SegmentHead& head, Interval range) {
  const std::uint64_t first = std::max(head.first_seq, range.first);
  return {.samples = {first, std::min(head.next_seq, range.next)},
          .first_robot_time_us = head.first_robot_time_us + (first - head.first_seq) * head.period_us,
          .period_us = head.period_us,
          .flags = head.flags,
          .clock_uncertainty_us = head.clock_uncertainty_us};
}

nlohmann::json json_of(const std::map<std::string, std::uint64_t>& lost_by_cause) {
  nlohmann::json out = nlohmann::json::object();
  for (const auto& [cause, samples] : lost_by_cause) out[cause] = samples;
  return out;
}

std::map<std::string, std::uint64_t> causes_from(const std::string& text) {
  std::map<std::string, std::uint64_t> causes;
  const nlohmann::json object = nlohmann::json::parse(text, nullptr, false);
  if (!object.is_object()) return causes;
  for (const auto& [cause, samples] : object.items()) {
    if (samples.is_number_unsigned()) causes[cause] = samples.get<std::uint64_t>();
  }
  return causes;
}

}  // namespace

DigestComputation::Progress DigestComputation::advance_span(SQLite::Database& database, std::uint64_t& max_samples) {
  const DigestSpan& span = spans_[span_];
  const Interval rest{next_seq_, span.samples.next};
  if (rest.first >= rest.next) return Progress::done;
  const std::vector<Lost> lost = read_lost(database, span.boot_key, rest);
  auto gap = lost.begin();
  const auto pass_lost = [&] {
    for (; gap != lost.end() && gap->samples.first <= next_seq_; ++gap) {
      tally_.add_lost(gap->samples, gap->cause);
      next_seq_ = std::max(next_seq_, gap->samples.next);
    }
  };
  SampleScanner scanner{database, all_channels()};
  scanner.begin(span.boot_key, rest);
  Segment segment;
  pass_lost();
  while (scanner.next(segment)) {
    if (segment.first_seq > next_seq_) return Progress::waiting;
    tally_.add(stretch(segment));
    hash_.add(span.boot_id, segment);
    next_seq_ = segment.next_seq();
    pass_lost();
    max_samples -= std::min<std::uint64_t>(max_samples, segment.samples.size());
    if (max_samples == 0) return Progress::more;
  }
  return next_seq_ >= span.samples.next ? Progress::done : Progress::waiting;
}

std::vector<DigestSpan> read_digest_spans(SQLite::Database& database, RunId run) {
  std::vector<DigestSpan> spans;
  SQLite::Statement query{database,
                          "SELECT boot_key, boot_id, first_seq, last_seq, sample_period_us"
                          " FROM run_span JOIN boot USING (boot_key)"
                          " WHERE run_id = ? AND last_seq IS NOT NULL ORDER BY span"};
  bind_all(query, run);
  while (query.executeStep()) {
    spans.push_back({query.getColumn(0).getInt64(),
                     unsigned_id(query.getColumn(1)),
                     {unsigned_id(query.getColumn(2)), unsigned_id(query.getColumn(3)) + 1},
                     query.getColumn(4).getUInt()});
  }
  return spans;
}

bool HeadTally::advance(SQLite::Database& database) {
  if (span_ == spans_.size()) return false;
  const DigestSpan& span = spans_[span_];
  if (!has_begun_) {
    tally_.begin_span(span.samples, span.period_us);
    for (const Lost& lost : read_lost(database, span.boot_key, span.samples)) tally_.add_lost(lost.samples, lost.cause);
    next_seq_ = span.samples.first;
    has_begun_ = true;
  }
  const Interval page{next_seq_, std::min(next_seq_ + kTalliedSamples, span.samples.next)};
  for (const SegmentHead& head : read_heads(database, span.boot_key, page, {})) tally_.add(stretch(head, page));
  next_seq_ = page.next;
  if (next_seq_ < span.samples.next) return true;
  tally_.end_span();
  has_begun_ = false;
  return ++span_ < spans_.size();
}

std::optional<RunDigest> read_digest(SQLite::Database& database, RunId run) {
  SQLite::Statement row{database, "SELECT * FROM run_certificate WHERE run_id = ? AND format BETWEEN 1 AND ?"};
  bind_all(row, run, std::int64_t{kDigestFormat});
  if (!row.executeStep()) return std::nullopt;
  RunDigest digest;
  digest.format = row.getColumn("format").getInt();
  digest.samples_expected = unsigned_id(row.getColumn("samples_expected"));
  digest.samples_live = unsigned_id(row.getColumn("samples_live"));
  digest.samples_backfilled = unsigned_id(row.getColumn("samples_backfilled"));
  digest.samples_lost = unsigned_id(row.getColumn("samples_lost"));
  digest.lost_by_cause = causes_from(row.getColumn("lost_by_cause").getString());
  digest.longest_gap_samples = unsigned_id(row.getColumn("longest_gap_samples"));
  digest.longest_gap_us = row.getColumn("longest_gap_us").getInt64();
  digest.worst_clock_uncertainty_us = row.getColumn("worst_clock_uncertainty_us").getInt64();
  digest.samples_without_clock = unsigned_id(row.getColumn("samples_without_clock"));
  digest.sha256 = row.getColumn("sha256").getString();
  digest.made_at_us = row.getColumn("made_at_us").getInt64();
  const bool is_before_schema_12 = row.getColumnCount() <= kColumnsBeforeSchema12;  // `verify` reads those as they are
  if (!is_before_schema_12 && !row.isColumnNull("missed_ticks")) {
    digest.missed =
        MissedTicks{unsigned_id(row.getColumn("missed_ticks")), unsigned_id(row.getColumn("longest_missed_ticks"))};
  }
  return digest;
}

void write_missed_ticks(SQLite::Database& database, RunId run, const RunDigest& counts) {
  SQLite::Statement add{database,
                        "UPDATE run_certificate SET missed_ticks = ?, longest_missed_ticks = ?"
                        " WHERE run_id = ? AND missed_ticks IS NULL AND samples_live + samples_backfilled = ?"};
  execute(add, counts.missed->count, counts.missed->longest, run, counts.samples_live + counts.samples_backfilled);
}

void write_digest(SQLite::Database& database, RunId run, const RunDigest& digest) {
  SQLite::Statement add{database,
                        "INSERT OR REPLACE INTO run_certificate SELECT ?,?,?,?,?,?,?,?,?,?,?,?,?,?,?"
                        " WHERE EXISTS (SELECT 1 FROM run WHERE run_id = ?1 AND state IN ('ended', 'interrupted'))"};
  std::optional<std::uint64_t> missed, longest;
  if (digest.missed) std::tie(missed, longest) = std::tuple{digest.missed->count, digest.missed->longest};
  execute(add, run, std::int64_t{digest.format}, digest.samples_expected, digest.samples_live,
          digest.samples_backfilled, digest.samples_lost, json_of(digest.lost_by_cause).dump(),
          digest.longest_gap_samples, digest.longest_gap_us, digest.worst_clock_uncertainty_us,
          digest.samples_without_clock, digest.sha256, digest.made_at_us, missed, longest);
}

}  // namespace server::storage
