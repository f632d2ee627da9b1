// The run's rows are copied by SQLite itself.
#include "server/storage/export/run_tables.hpp"

#include <fmt/format.h>

#include <iterator>
#include <stdexcept>

#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr std::size_t kSliceGaps = 5'000;

constexpr const char* kTables = R"sql(
CREATE TABLE audit (                       -- docs/database.md
  entry INTEGER PRIMARY KEY,
  at_us INTEGER,                           -- this to salt: NULL in entries of other robots and of accounts
  actor TEXT,
  peer TEXT,
  robot_id TEXT,
  action TEXT,
  subject TEXT,
  detail TEXT,
  salt BLOB,
  content_hash BLOB NOT NULL,
  hash BLOB NOT NULL
);
CREATE TABLE gap (
  span INTEGER NOT NULL,
  boot_id TEXT NOT NULL,
  first_seq INTEGER NOT NULL,
  last_seq INTEGER NOT NULL,
  cause TEXT NOT NULL,
  noticed_at_us INTEGER NOT NULL
);
)sql";

// Each is a slice, or a series of them: `piece` gives the key of the last row of the piece after {1}, NULL at the end,
// and the piece is what `sql` copies between {1} and {2}. {0} is the run. A robot's events are those of its samples,
// whenever they came; events of the station itself, and commands, are of the time between the run's beginning and its
// end. A database of a schema before `since` has none of it.
struct Copy {
  const char* sql;
  const char* piece = nullptr;
  std::int64_t since = 0;
};
constexpr std::int64_t kAuditSince = 5;
constexpr std::int64_t kReferenceSince = 7;
constexpr std::int64_t kRenewalsSince = 10;

constexpr Copy kCopies[] = {
    {"CREATE TABLE run AS SELECT * FROM store.run WHERE run_id = {0}"},
    {"CREATE TABLE span AS SELECT span, printf('%llu', boot_id) AS boot_id, first_seq, last_seq, firmware_version"
     " FROM store.run_span JOIN store.boot USING (boot_key) WHERE run_id = {0} ORDER BY span"},
    {"CREATE TABLE boot AS SELECT * FROM store.robot_boot WHERE boot_key IN"
     " (SELECT boot_key FROM store.run_span WHERE run_id = {0})"},
    // From the last estimate before a span's first sample to its last sample.
    {"CREATE TABLE clock AS SELECT DISTINCT robot_id, printf('%llu', boot_id) AS boot_id, robot_time_us,"
     " robot_time_us + utc_offset_us AS utc_us, utc_offset_us, uncertainty_us, drift_ppm, round_trip_us, "
     "station_step_us"
     " FROM store.run_span CROSS JOIN store.boot USING (boot_key) CROSS JOIN store.clock_estimate USING (boot_key)"
     " WHERE run_id = {0} AND robot_time_us >= coalesce((SELECT max(robot_time_us) FROM store.clock_estimate AS before"
     " WHERE before.boot_key = run_span.boot_key AND before.robot_time_us <= (SELECT first_robot_time_us"
     " + max(run_span.first_seq - segment.first_seq, 0) * period_us FROM store.segment"
     " WHERE segment.boot_key = run_span.boot_key AND segment.first_seq >= run_span.first_seq - 99"
     " AND segment.last_seq >= run_span.first_seq ORDER BY segment.first_seq LIMIT 1)), 0) AND robot_time_us <= "
     "(SELECT first_robot_time_us"
     " + (segment.last_seq - segment.first_seq) * period_us FROM store.segment"
     " WHERE segment.boot_key = run_span.boot_key AND segment.first_seq <= coalesce(run_span.last_seq,"
     " 9223372036854775807) ORDER BY segment.first_seq DESC LIMIT 1)"},
    {"CREATE TABLE event AS SELECT * FROM store.robot_event LIMIT 0"},
    {"INSERT INTO event SELECT robot_event.* FROM run JOIN store.robot_event USING (robot_id)"
     " WHERE event_row > {1} AND event_row <= {2}"
     " AND (EXISTS (SELECT 1 FROM span WHERE span.boot_id = robot_event.boot_id AND event_seq IS NOT NULL"
     " AND sample_seq >= first_seq AND sample_seq <= coalesce(last_seq, 9223372036854775807))"
     " OR (event_seq IS NULL AND received_at_us >= started_at_us"
     " AND received_at_us <= coalesce(ended_at_us, 9223372036854775807))"
     " OR (kind IN ('experiment_interrupted', 'experiment_paused') AND EXISTS (SELECT 1 FROM span WHERE span.boot_id = "
     "robot_event.boot_id)))",
     "SELECT max(event_row) FROM (SELECT event_row FROM store.event WHERE robot_id = (SELECT robot_id FROM run)"
     " AND event_row > {1} ORDER BY event_row LIMIT 1000)"},
    {"CREATE TABLE command AS SELECT * FROM store.robot_command LIMIT 0"},
    // Renewals of a lease that began before the run and went on in it: few commands come between, refused renewals.
    {"INSERT INTO command SELECT robot_command.* FROM run CROSS JOIN store.robot_command USING (robot_id)"
     " WHERE kind = 'renew_lease' AND coalesce(last_renewed_at_us, submitted_at_us) >= started_at_us"
     " AND submitted_at_us < started_at_us AND submitted_at_us >= (SELECT min(submitted_at_us) FROM"
     " (SELECT submitted_at_us FROM run AS this CROSS JOIN store.command AS made WHERE made.robot_id = this.robot_id"
     " AND submitted_at_us < this.started_at_us ORDER BY submitted_at_us DESC LIMIT 100))",
     nullptr, kRenewalsSince},
    {"INSERT INTO command SELECT robot_command.* FROM run JOIN store.robot_command USING (robot_id)"
     " WHERE submitted_at_us >= started_at_us AND submitted_at_us > {1} AND submitted_at_us <= {2}",
     "SELECT max(submitted_at_us) FROM (SELECT submitted_at_us FROM run CROSS JOIN store.command AS made"
     " WHERE made.robot_id = run.robot_id AND submitted_at_us > max({1}, started_at_us - 1)"
     " AND submitted_at_us <= coalesce(run.ended_at_us, 9223372036854775807) ORDER BY submitted_at_us LIMIT 1000)"},
    // The chain from the run's beginning to its end, and the entry before.
    {"CREATE TEMP TABLE edge AS SELECT (SELECT entry FROM store.audit WHERE at_us >= started_at_us ORDER BY at_us, "
     "entry"
     " LIMIT 1) AS first_entry, (SELECT entry FROM store.audit WHERE at_us <= coalesce(ended_at_us, "
     "9223372036854775807)"
     " ORDER BY at_us DESC, entry DESC LIMIT 1) AS last_entry FROM run",
     nullptr, kAuditSince},
    {"INSERT INTO main.audit SELECT entry, iif(shown, at_us, NULL), iif(shown, actor, NULL), iif(shown, peer, NULL),"
     " iif(shown, robot_id, NULL), iif(shown, action, NULL), iif(shown, subject, NULL), iif(shown, detail, NULL),"
     " iif(shown, salt, NULL), content_hash, hash FROM (SELECT made.*, made.robot_id = run.robot_id"
     " OR (made.robot_id = '' AND (action GLOB 'station.*' OR action GLOB 'store.*' OR action GLOB 'audit.*')) AS shown"
     " FROM store.audit AS made, main.run, edge WHERE entry > {1} AND entry <= {2} AND entry >= first_entry - 1)",
     "SELECT max(entry) FROM (SELECT entry FROM edge CROSS JOIN store.audit"
     " WHERE entry > {1} AND entry BETWEEN first_entry - 1 AND last_entry ORDER BY entry LIMIT 1000)",
     kAuditSince},
    {"CREATE TABLE marker AS SELECT * FROM store.run_marker WHERE run_id = {0}"},
    {"CREATE TABLE run_certificate AS SELECT * FROM store.run_certificate WHERE run_id = {0}"},
    {"CREATE TABLE in_force AS SELECT * FROM store.run_in_force WHERE run_id = {0}"},
    // A discarded run has none: its positions go at once.
    {"CREATE TABLE outside_reference AS SELECT * FROM store.outside_reference WHERE run_id = {0}"
     " AND completed_at_us IS NOT NULL AND removed_at_us IS NULL"
     " AND (SELECT state FROM main.run) <> 'discarded'",
     nullptr, kReferenceSince},
    {"CREATE TABLE outside_position (robot_time_us INTEGER PRIMARY KEY, position_m REAL, position_sd_m REAL)", nullptr,
     kReferenceSince},
    {"INSERT INTO main.outside_position SELECT robot_time_us, position_m, position_sd_m FROM store.outside_position"
     " WHERE reference_id = (SELECT reference_id FROM main.outside_reference)"
     " AND (robot_time_us > {1} OR {1} = 0) AND robot_time_us <= {2}",
     "SELECT max(robot_time_us) FROM (SELECT robot_time_us FROM store.outside_position WHERE reference_id ="
     " (SELECT reference_id FROM main.outside_reference) AND (robot_time_us > {1} OR {1} = 0)"
     " ORDER BY robot_time_us LIMIT 5000)",
     kReferenceSince},
};

constexpr std::size_t kReferenceCopies = 3;  // the last ones
constexpr int kMostReferenceTries = 5;

}  // namespace

RunTables::RunTables(SQLite::Database& file, const std::string& store, RunId run) : file_{file}, run_{run} {
  file_.exec(kTables);
  SQLite::Statement attach{file_, "ATTACH ? AS store"};
  execute(attach, store);
}

bool RunTables::advance(SQLite::Database& database, const std::vector<RecordedSpan>& spans) {
  if (copied_ == std::size(kCopies)) return add_gaps(database, spans);
  copy_some();
  return true;
}

void RunTables::copy_some() {
  const Copy& copy = kCopies[copied_];
  std::int64_t last = 0;
  const bool has_it = copy.since <= file_.execAndGet("PRAGMA store.user_version").getInt64();
  if (has_it && copy.piece != nullptr) {
    const SQLite::Column found = file_.execAndGet(fmt::format(fmt::runtime(copy.piece), run_, piece_after_));
    last = found.isNull() ? 0 : found.getInt64();
  }
  if (has_it && (copy.piece == nullptr || last != 0)) {
    file_.exec(fmt::format(fmt::runtime(copy.sql), run_, piece_after_, last));
  }
  piece_after_ = last;
  if (last == 0) ++copied_;
  if (copied_ < std::size(kCopies)) return;
  if (has_it && !reference_is_whole()) return copy_reference_again();
  file_.exec("DETACH store");
}

bool RunTables::reference_is_whole() {
  return file_
             .execAndGet(
                 "SELECT coalesce((SELECT samples FROM main.outside_reference), 0)"
                 " = (SELECT count(*) FROM main.outside_position)")
             .getInt() != 0;
}

// It was replaced or removed between two pieces.
void RunTables::copy_reference_again() {
  if (++reference_tries_ == kMostReferenceTries) {
    throw std::runtime_error{fmt::format("the reference of run {} lacks positions; remove it, or export again", run_)};
  }
  file_.exec("DROP TABLE main.outside_position; DROP TABLE main.outside_reference");
  copied_ = std::size(kCopies) - kReferenceCopies;
}

bool RunTables::add_gaps(SQLite::Database& database, const std::vector<RecordedSpan>& spans) {
  file_.exec("BEGIN");
  SQLite::Statement insert{file_, "INSERT INTO gap VALUES (?,?,?,?,?,?)"};
  const GapPage page = read_gaps(database, spans, gaps_after_, kSliceGaps);
  for (const Gap& gap : page.gaps) {
    execute(insert, gap.span, std::to_string(gap.boot_id), gap.first_seq, gap.last_seq, gap.cause, gap.noticed_at_us);
  }
  file_.exec("COMMIT");
  gaps_after_ = page.next;
  return gaps_after_.has_value();
}

}  // namespace server::storage
