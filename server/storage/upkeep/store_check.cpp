// The checks, one after the other, each in pages.
#include "server/storage/upkeep/store_check.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "server/runtime/exceptions.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/groups/segment_groups.hpp"
#include "server/storage/runs/run_digest.hpp"
#include "server/storage/runs/run_queries.hpp"
#include "server/storage/samples/interval_set.hpp"
#include "server/storage/samples/sample_scanner.hpp"

namespace server::storage {
namespace {

constexpr std::size_t kMostHoles = 100;  // named of a boot; the others are counted
constexpr std::int64_t kPageSegments = 1000;
constexpr std::uint64_t kPageSamples = 100'000;
constexpr std::uint64_t kEverySeq = std::numeric_limits<std::int64_t>::max();

std::vector<std::int64_t> numbers(SQLite::Database& database, const char* sql) {
  std::vector<std::int64_t> found;
  SQLite::Statement query{database, sql};
  while (query.executeStep()) found.push_back(query.getColumn(0).getInt64());
  return found;
}

// The first member of two digests that differs.
std::string difference(const RunDigest& found, const RunDigest& stored) {
  const auto number = [](const char* name, auto now, auto then) {
    return fmt::format("{} is {}, the certificate says {}", name, now, then);
  };
  if (found.samples_expected != stored.samples_expected) {
    return number("samples_expected", found.samples_expected, stored.samples_expected);
  }
  if (found.samples_live != stored.samples_live) return number("samples_live", found.samples_live, stored.samples_live);
  if (found.samples_backfilled != stored.samples_backfilled) {
    return number("samples_backfilled", found.samples_backfilled, stored.samples_backfilled);
  }
  if (found.samples_lost != stored.samples_lost) return number("samples_lost", found.samples_lost, stored.samples_lost);
  if (found.lost_by_cause != stored.lost_by_cause) return "the causes of its gaps are not those of the certificate";
  if (found.sha256 != stored.sha256) {
    return number("its samples were changed: their SHA-256", found.sha256, stored.sha256);
  }
  return "its longest gap, the ticks that the robot missed or its clock is not that of the certificate";
}

// Whether the extremes of the segment ?1, ?2 are those of the rows ?3 to ?4, in a database of this schema version.
std::string extremes_query(std::int64_t version) {
  std::string found;
  std::string differ;
  for (const station::SampleField& field : station::kSampleFields) {
    if (field.since_schema > version) continue;
    found += fmt::format("{0}min({1}) AS low_{1}, max({1}) AS high_{1}", found.empty() ? "" : ", ", field.name);
    differ +=
        fmt::format("{0}low_{1} IS NOT min_{1} OR high_{1} IS NOT max_{1}", differ.empty() ? "" : " OR ", field.name);
  }
  return fmt::format(
      "SELECT {} FROM (SELECT {} FROM sample WHERE row BETWEEN ?3 AND ?4), segment WHERE boot_key = ?1 AND first_seq = "
      "?2",
      differ, found);
}

class Checking {
 public:
  Checking(SQLite::Database& database, const StoreCheck& options, StoreFindings& findings)
      : database_{database}, options_{options}, findings_{findings} {}

  void check_rows_counter();
  void check_boots();
  void check_groups(std::int64_t boot_key);
  void check_owners();
  void check_spans(std::optional<RunId> run);
  void check_samples_of(RunId run);
  void check_digest(RunId run);
  void check_references();
  void check_integrity();

 private:
  // What a boot's segments and gaps cover, in order.
  struct Covered {
    std::uint64_t next_seq = 0;
    const char* by = "";
    std::uint64_t durable = 0;    // below it nothing may be missing
    std::vector<Interval> holes;  // of this page
    std::size_t found = 0;        // that are holes still when they are looked at again
  };
  template <class... Parts>
  void fault(fmt::format_string<Parts...> text, Parts&&... parts) {
    findings_.faults.push_back(fmt::format(text, std::forward<Parts>(parts)...));
  }
  void check_segments(std::int64_t boot_key, Interval range, const std::string& whose);
  std::uint64_t durable_next_seq(std::int64_t boot_key);
  void cover(Covered& covered, std::int64_t boot_key, Interval range, const char* by);
  void check_holes(Covered& covered, std::int64_t boot_key);
  void check_hole(Covered& covered, std::int64_t boot_key, Interval hole);
  void check_rows(SQLite::Statement& segment, std::int64_t boot_key, const std::string& whose);

  SQLite::Database& database_;
  const StoreCheck& options_;
  StoreFindings& findings_;
  bool has_groups_ = database_.tableExists("segment_group");  // an exported run has none
  SQLite::Statement rows_{database_, "SELECT count(*) FROM sample WHERE row BETWEEN ? AND ?"};
  SQLite::Statement extremes_{database_, extremes_query(database_.execAndGet("PRAGMA user_version").getInt64())};
};

void Checking::check_rows_counter() {
  const SQLite::Transaction moment{database_};
  const auto last_row = database_.execAndGet("SELECT coalesce(max(row), 0) FROM sample").getInt64();
  const auto next_row = database_.execAndGet("SELECT coalesce(max(value), 0) FROM meta WHERE name = 'next_row'");
  if (next_row.getInt64() > last_row) return;
  fault("next_row is {}, but sample has a row {}: rows would be written twice", next_row.getInt64(), last_row);
}

void Checking::check_boots() {
  for (const std::int64_t boot_key : numbers(database_, "SELECT boot_key FROM boot ORDER BY boot_key")) {
    check_segments(boot_key, {0, kEverySeq}, "");
    check_groups(boot_key);
  }
}

void Checking::check_groups(std::int64_t boot_key) {
  if (!options_.integrity || !has_groups_) return;
  for (const Interval& window : wrong_groups(database_, boot_key)) {
    fault("the group of samples {} to {} of boot key {} is not what its segments say: overviews may be wrong",
          window.first, window.next - 1, boot_key);
  }
}

// Segments and gaps of boots that are not there. Steps from key to key, for a foreign key check reads every segment.
void Checking::check_owners() {
  for (const char* table : {"segment", "gap"}) {
    const std::string next = fmt::format("SELECT min(boot_key) FROM {} WHERE boot_key > ?", table);
    SQLite::Statement step{database_, next};
    SQLite::Statement known{database_, "SELECT 1 FROM boot WHERE boot_key = ?"};
    std::int64_t boot_key = std::numeric_limits<std::int64_t>::min();
    for (;;) {
      bind_all(step, boot_key);
      step.executeStep();
      if (step.getColumn(0).isNull()) break;
      boot_key = step.getColumn(0).getInt64();
      bind_all(known, boot_key);
      if (!known.executeStep()) fault("a {} belongs to boot key {}, which is not there", table, boot_key);
    }
  }
}

void Checking::check_segments(std::int64_t boot_key, Interval range, const std::string& whose) {
  Covered covered;
  if (whose.empty()) covered.durable = durable_next_seq(boot_key);
  std::map<std::uint64_t, std::uint64_t> gaps;  // first to next
  SQLite::Statement gap{database_, "SELECT first_seq, last_seq FROM gap WHERE boot_key = ? AND first_seq < ?"};
  bind_all(gap, boot_key, range.next);
  while (gap.executeStep()) gaps.emplace(unsigned_id(gap.getColumn(0)), unsigned_id(gap.getColumn(1)) + 1);
  gap.reset();

  auto due = gaps.begin();
  std::uint64_t from = range.first < 99 ? 0 : range.first - 99;
  std::int64_t read = kPageSegments;
  while (read == kPageSegments) {
    std::optional<SQLite::Transaction> moment{std::in_place, database_};
    SQLite::Statement segment{database_,
                              "SELECT first_seq, last_seq, first_row, last_row FROM segment"
                              " WHERE boot_key = ? AND first_seq >= ? AND first_seq < ? ORDER BY first_seq LIMIT ?"};
    bind_all(segment, boot_key, from, range.next, kPageSegments);
    for (read = 0; segment.executeStep(); ++read) {
      const Interval samples{unsigned_id(segment.getColumn(0)), unsigned_id(segment.getColumn(1)) + 1};
      from = samples.first + 1;
      if (samples.next <= range.first) continue;
      for (; due != gaps.end() && due->first <= samples.first; ++due) {
        cover(covered, boot_key, {due->first, due->second}, "a gap");
      }
      cover(covered, boot_key, samples, "a segment");
      check_rows(segment, boot_key, whose);
    }
    segment.reset();
    moment.reset();
    check_holes(covered, boot_key);
  }
  for (; due != gaps.end(); ++due) cover(covered, boot_key, {due->first, due->second}, "a gap");
  if (covered.next_seq < covered.durable) covered.holes.push_back({covered.next_seq, covered.durable});
  check_holes(covered, boot_key);
  if (covered.found > kMostHoles) {
    fault("and {} more holes of boot key {}", covered.found - kMostHoles, boot_key);
  }
}

void Checking::check_holes(Covered& covered, std::int64_t boot_key) {
  for (const Interval& hole : covered.holes) check_hole(covered, boot_key, hole);
  covered.holes.clear();
}

std::uint64_t Checking::durable_next_seq(std::int64_t boot_key) {
  SQLite::Statement query{database_, "SELECT durable_next_seq FROM boot WHERE boot_key = ?"};
  bind_all(query, boot_key);
  return query.executeStep() ? unsigned_id(query.getColumn(0)) : 0;
}

// Samples that every boot should have and that were in nothing when it was walked: they may have been purged meanwhile.
void Checking::check_hole(Covered& covered, std::int64_t boot_key, Interval hole) {
  const SQLite::Transaction moment{database_};
  IntervalSet found;
  const std::uint64_t from = hole.first < 99 ? 0 : hole.first - 99;  // where a segment that reaches into it may begin
  for (const auto& [table, least] : {std::pair{"gap", std::uint64_t{0}}, std::pair{"segment", from}}) {
    SQLite::Statement query{database_, fmt::format("SELECT first_seq, last_seq FROM {} WHERE boot_key = ?"
                                                   " AND first_seq >= ? AND first_seq < ? AND last_seq >= ?"
                                                   " ORDER BY first_seq",
                                                   table)};
    bind_all(query, boot_key, least, hole.next, hole.first);
    while (query.executeStep()) found.insert({unsigned_id(query.getColumn(0)), unsigned_id(query.getColumn(1)) + 1});
  }
  for (const Interval& missing : found.missing(hole)) {
    if (++covered.found > kMostHoles) continue;
    fault("samples {} to {} of boot key {} are neither stored nor in a gap", missing.first, missing.next - 1, boot_key);
  }
}

void Checking::cover(Covered& covered, std::int64_t boot_key, Interval range, const char* by) {
  if (range.first < covered.next_seq) {
    fault("{} of boot key {} begins at sample {}, but {} before it ends only at {}", by, boot_key, range.first,
          covered.by, covered.next_seq - 1);
  }
  const Interval hole{covered.next_seq, std::min(range.first, covered.durable)};
  if (hole.first < hole.next) covered.holes.push_back(hole);
  if (range.next > covered.next_seq) {
    covered.next_seq = range.next;
    covered.by = by;
  }
}

void Checking::check_rows(SQLite::Statement& segment, std::int64_t boot_key, const std::string& whose) {
  const std::int64_t first_seq = segment.getColumn(0).getInt64();
  const std::int64_t first_row = segment.getColumn(2).getInt64();
  const std::int64_t last_row = segment.getColumn(3).getInt64();
  bind_all(rows_, first_row, last_row);
  rows_.executeStep();
  const std::int64_t found = rows_.getColumn(0).getInt64();
  rows_.reset();
  ++findings_.segments;
  findings_.samples += static_cast<std::uint64_t>(found);
  if (found != last_row - first_row + 1) {
    fault("{}the segment at sample {} of boot key {} has {} of its {} rows", whose, first_seq, boot_key, found,
          last_row - first_row + 1);
  }
  if (!options_.integrity) return;
  bind_all(extremes_, boot_key, first_seq, first_row, last_row);
  if (extremes_.executeStep() && extremes_.getColumn(0).getInt() != 0) {
    fault("{}the extremes of the segment at sample {} of boot key {} are not those of its samples", whose, first_seq,
          boot_key);
  }
  extremes_.reset();
}

void Checking::check_spans(std::optional<RunId> only) {
  SQLite::Statement spans{database_,
                          "SELECT run_id, span, boot_key, first_seq, last_seq, run.state, run.robot_id, boot.robot_id,"
                          " run.ended_at_us IS NULL, boot.boot_id FROM run_span JOIN run USING (run_id)"
                          " LEFT JOIN boot USING (boot_key) WHERE ?1 IS NULL OR run_id = ?1"};
  bind_all(spans, only);
  while (spans.executeStep()) {
    const std::int64_t run = spans.getColumn(0).getInt64();
    const std::int64_t span = spans.getColumn(1).getInt64();
    const std::int64_t boot_key = spans.getColumn(2).getInt64();
    const bool is_open = spans.getColumn(5).getString() == text(RunState::open);
    if (spans.getColumn(7).isNull()) {
      fault("run {}: span {} is of boot key {}, which is not there", run, span, boot_key);
      continue;
    }
    if (spans.getColumn(6).getString() != spans.getColumn(7).getString()) {
      fault("run {}: span {} is of a boot of another robot", run, span);
    }
    if (is_open != (spans.getColumn(8).getInt() != 0)) fault("run {}: its state and its end contradict", run);
    if (spans.getColumn(4).isNull()) {
      if (!is_open) fault("run {}: has ended, but its span {} has not", run, span);
      continue;
    }
    const std::uint64_t next = known_next_seq(database_, {}, boot_key, unsigned_id(spans.getColumn(9)));
    const std::uint64_t last = unsigned_id(spans.getColumn(4));
    if (last >= next) fault("run {}: span {} ends at sample {}, but its boot made only {}", run, span, last, next);
  }
}

void Checking::check_samples_of(RunId run) {
  for (const DigestSpan& span : read_digest_spans(database_, run)) {
    check_segments(span.boot_key, span.samples, fmt::format("run {}: ", run));
  }
}

void Checking::check_digest(RunId run) {
  std::optional<DigestComputation> computation;
  std::optional<RunDigest> stored;  // as it was when the last page was read
  auto progress = DigestComputation::Progress::more;
  while (progress == DigestComputation::Progress::more) {
    const SQLite::Transaction moment{database_};
    stored = read_digest(database_, run);
    const std::optional<RunState> state = read_run_state(database_, run);
    if (!state || *state == RunState::open || *state == RunState::discarded) return;
    if (!computation) {
      computation.emplace(read_digest_spans(database_, run), stored ? stored->format : kDigestFormat);
    }
    try {
      progress = computation->advance(database_, kPageSamples);
    } catch (const std::runtime_error& error) {  // a row is not there, or cannot be read
      return fault("run {}: {}", run, runtime::text_of(error));
    }
  }
  const bool is_complete = progress == DigestComputation::Progress::done;
  if (!stored) {
    ++(is_complete ? findings_.runs_without_digest : findings_.runs_incomplete);
  } else if (!is_complete) {
    fault("run {}: {} is missing, but the certificate says that nothing is", run, computation->place());
  } else if (!computation->digest().agrees_with(*stored)) {
    fault("run {}: {}", run, difference(computation->digest(), *stored));
  } else {
    ++findings_.runs_verified;
  }
}

void Checking::check_references() {
  for (const char* table : {"boot", "event", "event_gap", "run", "run_span", "run_note", "run_certificate", "marker",
                            "in_force", "clock_estimate", "outside_reference", "outside_position"}) {
    SQLite::Statement check{database_, fmt::format("PRAGMA foreign_key_check({})", table)};
    while (check.executeStep()) {
      fault("a row of {} names a {} that is not there", table, check.getColumn(2).getString());
    }
  }
}

void Checking::check_integrity() {
  SQLite::Statement check{database_, "PRAGMA integrity_check"};
  while (check.executeStep()) {
    const std::string line = check.getColumn(0).getString();
    if (line != "ok") fault("SQLite: {}", line);
  }
}

void check_all(SQLite::Database& database, const StoreCheck& options, StoreFindings& findings) {
  Checking checking{database, options, findings};
  if (options.integrity) checking.check_integrity();
  checking.check_spans(options.run);
  if (options.run) {
    checking.check_samples_of(*options.run);
    return checking.check_digest(*options.run);
  }
  checking.check_rows_counter();
  checking.check_references();
  checking.check_owners();
  checking.check_boots();
  for (const RunId run : numbers(database, "SELECT run_id FROM run WHERE state IN ('ended', 'interrupted')")) {
    checking.check_digest(run);
  }
}

}  // namespace

Result<StoreFindings> check_store(SQLite::Database& database, const StoreCheck& options) {
  StoreFindings findings;
  if (options.run && !read_run_state(database, *options.run)) {
    return fail(ErrorCode::not_found, fmt::format("there is no run {}", *options.run));
  }
  try {
    check_all(database, options, findings);
  } catch (const SQLite::Exception& error) {  // what cannot be read is damaged; anything else is not the database's
    if (error.getErrorCode() != SQLITE_CORRUPT && error.getErrorCode() != SQLITE_NOTADB) throw;
    findings.faults.push_back(fmt::format("SQLite: {}", runtime::text_of(error)));
  }
  return findings;
}

}  // namespace server::storage
