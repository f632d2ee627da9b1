// Two statements: the segments by index, and the rows by number. Rows of segments that follow one another in the file
// are stepped through as one range.
#include "server/storage/samples/sample_scanner.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <stdexcept>

#include "server/station/state/unknown_values.hpp"
#include "server/storage/samples/stored_rows.hpp"

namespace server::storage {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// A segment that holds the first sample of the range begins at most 99 before it.
constexpr const char* kInRange =
    " FROM segment WHERE boot_key = ?1 AND first_seq >= ?2 - 99 AND first_seq <= ?3 AND last_seq >= ?2"
    " ORDER BY first_seq";

constexpr std::int64_t kUnknownValuesSince = 7;  // version: the tools read older ones, too
constexpr int kContextColumn = 9;                // of segment_query(): the first of kBatchFields

// Of a database of this version of the schema.
std::string segment_query(std::int64_t version) {
  std::string sql =
      "SELECT first_seq, last_seq, first_row, first_robot_time_us, period_us,"
      " iif(first_received_at_us = 0, received_at_us, first_received_at_us), received_at_us, utc_offset_us,"
      " clock_uncertainty_us";
  station::for_each_batch_field([&](const auto& field) { (sql += ", ") += column_or_null(field, version); });
  return sql + ", " + (version >= kUnknownValuesSince ? "unknown_values" : "NULL") + kInRange;
}

// The largest seq of the range that SQLite can hold.
std::int64_t last_of(Interval samples) {
  constexpr std::uint64_t kLargest = std::numeric_limits<std::int64_t>::max();
  return static_cast<std::int64_t>(std::min(samples.next - 1, kLargest));
}

void bind_range(sqlite3_stmt* statement, std::int64_t boot_key, Interval samples) {
  sqlite3_bind_int64(statement, 1, boot_key);
  sqlite3_bind_int64(statement, 2, static_cast<std::int64_t>(samples.first));
  sqlite3_bind_int64(statement, 3, last_of(samples));
}

std::optional<float> optional_at(sqlite3_stmt* row, int column) {
  const bool is_null = sqlite3_column_type(row, column) == SQLITE_NULL;
  return is_null ? std::nullopt : std::optional{static_cast<float>(sqlite3_column_double(row, column))};
}

template <class Named, class Enumerator>
void read_enumerator(sqlite3_stmt* row, int column, Named& last, Enumerator& into) {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(row, column));
  if (text != nullptr && last.name != text) {
    last.name = text;
    last.number = station::number_of(enumerator_from<Enumerator>(last.name));
  }
  into = static_cast<Enumerator>(last.number);
}

}  // namespace

SampleScanner::SampleScanner(SQLite::Database& database, Channels channels) : database_{database}, channels_{channels} {
  const std::int64_t version = database.execAndGet("PRAGMA user_version").getInt64();
  segments_ = prepare_raw(database, segment_query(version));
  std::string sql = "SELECT row";
  for (std::size_t index = 0; index < kChannels; ++index) {
    if (channels[index]) (sql += ", ") += column_or_null(station::kSampleFields[index], version);
  }
  rows_ = prepare_raw(database, sql + " FROM sample WHERE row >= ?1 ORDER BY row");
}

void SampleScanner::begin(std::int64_t boot_key, Interval samples) {
  end();
  boot_key_ = boot_key;
  range_ = samples;
  if (samples.next <= samples.first) return;
  bind_range(segments_.get(), boot_key, samples);
  scanning_ = true;
}

bool SampleScanner::next(Segment& into) {
  if (!scanning_) return false;
  const int result = sqlite3_step(segments_.get());
  if (result == SQLITE_DONE) {
    end();
    return false;
  }
  if (result != SQLITE_ROW) fail_with(database_);
  const std::int64_t first_row = read_segment(into);
  read_rows(first_row, into);
  return true;
}

void SampleScanner::end() {
  sqlite3_reset(segments_.get());
  sqlite3_reset(rows_.get());
  next_row_ = 0;
  scanning_ = false;
}

std::int64_t SampleScanner::read_segment(Segment& into) {
  sqlite3_stmt* row = segments_.get();
  const std::uint64_t first_seq = unsigned_at(row, 0);
  const std::uint64_t first = std::max(first_seq, range_.first);
  const std::uint64_t next = std::min(unsigned_at(row, 1) + 1, range_.next);
  const std::uint64_t skipped = first - first_seq;
  station::SampleContext& context = into.context;
  into.boot_key = boot_key_;
  into.first_seq = first;
  into.samples.resize(next - first);
  context.period_us = static_cast<std::uint32_t>(unsigned_at(row, 4));
  into.first_robot_time_us = unsigned_at(row, 3) + skipped * context.period_us;
  into.first_received_at_us = sqlite3_column_int64(row, 5);
  into.received_at_us = sqlite3_column_int64(row, 6);
  into.utc_offset_us = sqlite3_column_int64(row, 7);
  into.clock_uncertainty_us = sqlite3_column_int64(row, 8);
  read_context(context);
  return sqlite3_column_int64(row, 2) + static_cast<std::int64_t>(skipped);
}

void SampleScanner::read_context(station::SampleContext& into) {
  sqlite3_stmt* row = segments_.get();
  int column = kContextColumn;
  station::for_each_batch_field([&]<class Value>(const station::BatchField<Value>& field) {
    Value& value = into.*field.member;
    if constexpr (station::BatchField<Value>::kKind == station::FieldKind::enumerator) {
      read_enumerator(row, column, last_texts_[static_cast<std::size_t>(column - kContextColumn)], value);
    } else if constexpr (station::BatchField<Value>::kKind == station::FieldKind::number) {
      value = optional_at(row, column);
    } else {
      value = static_cast<Value>(unsigned_at(row, column));
    }
    ++column;
  });
  const auto* unknown = reinterpret_cast<const char*>(sqlite3_column_text(row, column));
  if (unknown != nullptr) set_unknown(into, unknown);
}

void SampleScanner::read_rows(std::int64_t first_row, Segment& into) {
  sqlite3_stmt* row = rows_.get();
  if (next_row_ != first_row) seek(first_row);
  for (station::Sample& sample : into.samples) {
    const int result = sqlite3_step(row);
    if (result != SQLITE_ROW && result != SQLITE_DONE) fail_with(database_);
    if (result == SQLITE_DONE || sqlite3_column_int64(row, 0) != next_row_) {
      throw std::runtime_error{
          fmt::format("row {} of the segment at sample {} of boot key {} is missing: the database "
                      "is damaged",
                      next_row_, into.first_seq, into.boot_key)};
    }
    ++next_row_;
    int column = 0;
    for (std::size_t index = 0; index < kChannels; ++index) {
      sample.*kSampleMembers[index] = channels_[index] ? float_at(row, ++column) : kNaN;
    }
  }
}

void SampleScanner::seek(std::int64_t row) {
  sqlite3_reset(rows_.get());
  sqlite3_bind_int64(rows_.get(), 1, row);
  next_row_ = row;
}

std::vector<SegmentHead> read_heads(SQLite::Database& database, std::int64_t boot_key, Interval samples,
                                    OverviewChannels channels, std::size_t limit) {
  std::vector<SegmentHead> heads;
  if (samples.next <= samples.first) return heads;
  std::string sql =
      "SELECT first_seq, last_seq, first_robot_time_us, period_us, utc_offset_us, clock_uncertainty_us, flags";
  const std::int64_t version = database.execAndGet("PRAGMA user_version").getInt64();
  for (std::size_t index = 0; index < kOverviewChannels; ++index) {
    if (!channels[index]) continue;
    const ExtremeColumns columns = extreme_columns(index, version);
    sql += fmt::format(", {}, {}", columns.min, columns.max);
  }
  const RawStatement statement = prepare_raw(database, sql + kInRange + " LIMIT ?4");
  sqlite3_stmt* row = statement.get();
  bind_range(row, boot_key, samples);
  sqlite3_bind_int64(row, 4, static_cast<std::int64_t>(limit));
  int result = SQLITE_ROW;
  while ((result = sqlite3_step(row)) == SQLITE_ROW) {
    SegmentHead& head = heads.emplace_back();
    head.first_seq = unsigned_at(row, 0);
    head.next_seq = unsigned_at(row, 1) + 1;
    head.first_robot_time_us = unsigned_at(row, 2);
    head.period_us = static_cast<std::uint32_t>(unsigned_at(row, 3));
    head.utc_offset_us = sqlite3_column_int64(row, 4);
    head.clock_uncertainty_us = sqlite3_column_int64(row, 5);
    head.flags = static_cast<std::uint32_t>(unsigned_at(row, 6));
    int column = 6;
    for (std::size_t index = 0; index < kOverviewChannels; ++index) {
      head.min[index] = channels[index] ? float_at(row, ++column) : kNaN;
      head.max[index] = channels[index] ? float_at(row, ++column) : kNaN;
    }
  }
  if (result != SQLITE_DONE) fail_with(database);
  return heads;
}

}  // namespace server::storage
