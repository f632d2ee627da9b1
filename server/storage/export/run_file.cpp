// Samples come through the scanner.
#include "server/storage/export/run_file.hpp"

#include <fmt/format.h>

#include "server/station/state/unknown_values.hpp"
#include "server/storage/database/schema.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/export/run_file_about.hpp"
#include "server/storage/export/run_file_views.hpp"

namespace server::storage {
namespace {

constexpr std::size_t kSliceSamples = 2'500;

constexpr const char* kPlaceColumns = R"sql(
CREATE TABLE sample (
  span INTEGER NOT NULL,
  boot_id TEXT NOT NULL,
  seq INTEGER NOT NULL,
  robot_time_us INTEGER NOT NULL,
  t_s REAL NOT NULL,                       -- since the first sample of the span, on the robot's clock
  utc_us INTEGER NOT NULL,
  clock_uncertainty_us INTEGER NOT NULL,   -- half-width; -1: there was no estimate
  first_received_at_us INTEGER NOT NULL,
  received_at_us INTEGER NOT NULL,
)sql";
constexpr int kPlaceColumnCount = 9, kSeqColumn = 3, kClockColumn = 7;  // counted from 1
constexpr const char* kOtherColumns =
    R"sql(  gap_before INTEGER NOT NULL,             -- samples that are missing right before this one
  gap_after INTEGER NOT NULL,              -- and after it, to the end of its span
  unknown_values TEXT,                     -- JSON: numbers of enumerators that are 'unknown'; NULL: there are none
  missed_ticks_before INTEGER NOT NULL     -- ticks at which the robot made no sample, right before this one
);
)sql";
constexpr int kOtherColumnCount = 4;
constexpr int kGapColumn =
    kPlaceColumnCount + static_cast<int>(station::kSampleFieldCount + station::kBatchFieldCount) + 1;

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

std::int64_t signed_seq(std::uint64_t seq) { return static_cast<std::int64_t>(seq); }

}  // namespace

RunFile::RunFile(std::filesystem::path path, std::string store, std::vector<RecordedSpan> spans, ExportQuery query)
    : path_{std::move(path)}, store_{std::move(store)}, spans_{std::move(spans)}, query_{query} {}

bool RunFile::advance(SQLite::Database& database) {
  if (!file_) {
    begin();
  } else if (tables_) {
    if (tables_->advance(database, spans_)) return true;
    tables_.reset();
    file_->exec(run_file_views());
    explain_run_file(*file_);
    file_->exec("BEGIN");
    insert_ = std::make_unique<SQLite::Statement>(*file_, insert_sample());
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
  file_->exec(create_sample());
  tables_.emplace(*file_, store_, query_.run);
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

// Values stay bound from row to row: of each sample only those are bound that are its own.
void RunFile::add(const ExportSegment& exported) {
  const Segment& segment = exported.part->segment;
  bind_shared(exported);
  for (std::size_t index = 0; index < segment.samples.size(); ++index) {
    const std::uint64_t robot_time_us = segment.robot_time_us(index);
    int column = kSeqColumn;
    bind_value(*insert_, column, signed_seq(segment.first_seq + index));
    bind_value(*insert_, ++column, robot_time_us);
    bind_value(*insert_, ++column, seconds(exported.since_us(robot_time_us)));
    bind_value(*insert_, ++column, static_cast<std::int64_t>(robot_time_us) + segment.utc_offset_us);
    column = kPlaceColumnCount;
    for (const float value : values_of(segment.samples[index])) bind_value(*insert_, ++column, value);
    if (index <= 1) {
      bind_value(*insert_, kGapColumn, signed_seq(index == 0 ? exported.gap_before : 0));
      bind_value(*insert_, kGapColumn + 3, signed_seq(index == 0 ? exported.missed_before : 0));
    }
    if (index + 1 == segment.samples.size()) bind_value(*insert_, kGapColumn + 1, signed_seq(exported.gap_after));
    insert_->exec();
    insert_->reset();
  }
}

void RunFile::bind_shared(const ExportSegment& exported) {
  const Segment& segment = exported.part->segment;
  insert_->tryReset();
  bind_value(*insert_, 1, exported.part->span);
  bind_value(*insert_, 2, std::to_string(exported.part->boot_id));
  int column = kClockColumn;
  bind_value(*insert_, column, segment.clock_uncertainty_us);
  bind_value(*insert_, ++column, segment.first_received_at_us);
  bind_value(*insert_, ++column, segment.received_at_us);
  column = kPlaceColumnCount + static_cast<int>(station::kSampleFieldCount);
  station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
    const Value& value = segment.context.*field.member;
    if constexpr (station::BatchField<Value>::kKind == station::FieldKind::id) {
      bind_value(*insert_, ++column, std::to_string(value));
    } else {
      bind_value(*insert_, ++column, station::text_or_value(value));
    }
  });
  bind_value(*insert_, kGapColumn + 1, std::int64_t{0});
  bind_value(*insert_, kGapColumn + 2, unknown_values(segment.context));
}

}  // namespace server::storage
