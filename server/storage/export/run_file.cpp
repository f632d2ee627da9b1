// The run's rows of other tables are copied by SQLite itself; samples come through the scanner.
#include "server/storage/export/run_file.hpp"

#include <fmt/format.h>

#include <iterator>
#include <stdexcept>

#include "server/station/state/unknown_values.hpp"
#include "server/storage/database/schema.hpp"
#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr std::size_t kSliceSamples = 2'500;
constexpr std::size_t kSliceGaps = 5'000;

constexpr const char* kPlaceColumns = R"sql(
CREATE TABLE sample (
  span INTEGER NOT NULL,
  boot_id TEXT NOT NULL,
  seq INTEGER NOT NULL,
  robot_time_us INTEGER NOT NULL,
  utc_us INTEGER NOT NULL,
  clock_uncertainty_us INTEGER NOT NULL,   -- half-width; -1: there was no estimate
  first_received_at_us INTEGER NOT NULL,
  received_at_us INTEGER NOT NULL,
)sql";
constexpr int kPlaceColumnCount = 8;
constexpr const char* kOtherColumns =
    R"sql(  gap_before INTEGER NOT NULL,             -- samples that are missing right before this one
  gap_after INTEGER NOT NULL,              -- and after it, to the end of its span
  unknown_values TEXT                      -- JSON: numbers of enumerators that are 'unknown'; NULL: there are none
);
)sql";
constexpr int kOtherColumnCount = 3;

template <station::FieldKind kind>
constexpr const char* sql_type() {
  if (kind == station::FieldKind::number) return "REAL";
  return kind == station::FieldKind::count ? "INTEGER NOT NULL" : "TEXT NOT NULL";
}

std::string create_sample() {
  std::string sql = kPlaceColumns;
  for (const station::SampleField& field : station::kSampleFields) sql += fmt::format("  {} REAL,\n", field.name);
  station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
    sql += fmt::format("  {} {},\n", field.name, sql_type<station::BatchField<Value>::kKind>());
  });
  return sql + kOtherColumns;
}

std::string insert_sample() {
  std::string sql = "INSERT INTO sample VALUES (?";
  constexpr std::size_t kColumns =
      kPlaceColumnCount + station::kSampleFieldCount + station::kBatchFieldCount + kOtherColumnCount;
  for (std::size_t column = 1; column < kColumns; ++column) sql += ",?";
  return sql + ")";
}

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

constexpr Copy kCopies[] = {
    {"CREATE TABLE run AS SELECT * FROM store.run WHERE run_id = {0}"},
    {"CREATE TABLE span AS SELECT span, printf('%llu', boot_id) AS boot_id, first_seq, last_seq, firmware_version"
     " FROM store.run_span JOIN store.boot USING (boot_key) WHERE run_id = {0} ORDER BY span"},
    {"CREATE TABLE event AS SELECT * FROM store.robot_event LIMIT 0"},
    {"INSERT INTO event SELECT robot_event.* FROM run JOIN store.robot_event USING (robot_id)"
     " WHERE event_row > {1} AND event_row <= {2}"
     " AND (EXISTS (SELECT 1 FROM span WHERE span.boot_id = robot_event.boot_id AND event_seq IS NOT NULL"
     " AND sample_seq >= first_seq AND sample_seq <= coalesce(last_seq, 9223372036854775807))"
     " OR (event_seq IS NULL AND received_at_us >= started_at_us"
     " AND received_at_us <= coalesce(ended_at_us, 9223372036854775807)))",
     "SELECT max(event_row) FROM (SELECT event_row FROM store.event WHERE robot_id = (SELECT robot_id FROM run)"
     " AND event_row > {1} ORDER BY event_row LIMIT 1000)"},
    {"CREATE TABLE command AS SELECT * FROM store.robot_command LIMIT 0"},
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

std::int64_t signed_seq(std::uint64_t seq) { return static_cast<std::int64_t>(seq); }

}  // namespace

RunFile::RunFile(std::filesystem::path path, std::string store, std::vector<RecordedSpan> spans, ExportQuery query)
    : path_{std::move(path)}, store_{std::move(store)}, spans_{std::move(spans)}, query_{query} {}

bool RunFile::advance(SQLite::Database& database) {
  if (!file_) {
    begin();
  } else if (copied_ < std::size(kCopies)) {
    copy_some();
  } else if (!insert_) {
    add_gaps(database);
  } else {
    return add_samples(database);
  }
  return true;
}

void RunFile::begin() {
  file_ = std::make_unique<SQLite::Database>(path_.string(),
                                             SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE | SQLite::OPEN_URI);
  file_->exec("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF");
  file_->exec(
      fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {}", kRunFileApplicationId, kRunFileVersion));
  file_->exec(create_sample() + kTables);
  SQLite::Statement attach{*file_, "ATTACH ? AS store"};
  execute(attach, store_);
}

void RunFile::copy_some() {
  const Copy& copy = kCopies[copied_];
  std::int64_t last = 0;
  const bool has_it = copy.since <= file_->execAndGet("PRAGMA store.user_version").getInt64();
  if (has_it && copy.piece != nullptr) {
    const SQLite::Column found = file_->execAndGet(fmt::format(fmt::runtime(copy.piece), query_.run, piece_after_));
    last = found.isNull() ? 0 : found.getInt64();
  }
  if (has_it && (copy.piece == nullptr || last != 0)) {
    file_->exec(fmt::format(fmt::runtime(copy.sql), query_.run, piece_after_, last));
  }
  piece_after_ = last;
  if (last == 0) ++copied_;
  if (copied_ < std::size(kCopies)) return;
  if (has_it && !reference_is_whole()) return copy_reference_again();
  file_->exec("DETACH store; BEGIN");
}

bool RunFile::reference_is_whole() {
  return file_
             ->execAndGet(
                 "SELECT coalesce((SELECT samples FROM main.outside_reference), 0)"
                 " = (SELECT count(*) FROM main.outside_position)")
             .getInt() != 0;
}

// It was replaced or removed between two pieces.
void RunFile::copy_reference_again() {
  if (++reference_tries_ == kMostReferenceTries) {
    throw std::runtime_error{
        fmt::format("the reference of run {} lacks positions; remove it, or export again", query_.run)};
  }
  file_->exec("DROP TABLE main.outside_position; DROP TABLE main.outside_reference");
  copied_ = std::size(kCopies) - kReferenceCopies;
}

void RunFile::add_gaps(SQLite::Database& database) {
  SQLite::Statement insert{*file_, "INSERT INTO gap VALUES (?,?,?,?,?)"};
  const GapPage page = read_gaps(database, spans_, gaps_after_, kSliceGaps);
  for (const Gap& gap : page.gaps) {
    execute(insert, std::to_string(gap.boot_id), gap.first_seq, gap.last_seq, gap.cause, gap.noticed_at_us);
  }
  gaps_after_ = page.next;
  if (!gaps_after_) insert_ = std::make_unique<SQLite::Statement>(*file_, insert_sample());
}

bool RunFile::add_samples(SQLite::Database& database) {
  while (const auto segment = segments_.next()) add(*segment);
  if (at_end_) {
    insert_.reset();
    file_->exec("COMMIT");
    file_.reset();
    return false;
  }
  SegmentPage page = read_segments(database, spans_, after_, kSliceSamples, query_.channels);
  after_ = page.next;
  at_end_ = !after_;
  segments_.give(std::move(page));
  return true;
}

void RunFile::add(const ExportSegment& exported) {
  const Segment& segment = exported.part->segment;
  const std::string boot_id = std::to_string(exported.part->boot_id);
  bind_shared(segment.context);
  for (std::size_t index = 0; index < segment.samples.size(); ++index) {
    const std::uint64_t robot_time_us = segment.robot_time_us(index);
    bind_all(*insert_, exported.part->span, boot_id, signed_seq(segment.first_seq + index), robot_time_us,
             static_cast<std::int64_t>(robot_time_us) + segment.utc_offset_us, segment.clock_uncertainty_us,
             segment.first_received_at_us, segment.received_at_us);
    int column = kPlaceColumnCount;
    for (const float value : values_of(segment.samples[index])) bind_value(*insert_, ++column, value);
    column += static_cast<int>(station::kBatchFieldCount);
    bind_value(*insert_, ++column, signed_seq(index == 0 ? exported.gap_before : 0));
    bind_value(*insert_, ++column, signed_seq(index + 1 == segment.samples.size() ? exported.gap_after : 0));
    insert_->exec();
  }
}

// Values stay bound from row to row.
void RunFile::bind_shared(const station::SampleContext& context) {
  insert_->tryReset();
  int column = kPlaceColumnCount + static_cast<int>(station::kSampleFieldCount);
  station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
    const Value& value = context.*field.member;
    if constexpr (station::BatchField<Value>::kKind == station::FieldKind::id) {
      bind_value(*insert_, ++column, std::to_string(value));
    } else {
      bind_value(*insert_, ++column, station::text_or_value(value));
    }
  });
  bind_value(*insert_, column + kOtherColumnCount, unknown_values(context));
}

}  // namespace server::storage
