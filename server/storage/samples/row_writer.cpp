// Two prepared statements, one of many rows and one of a single row; the extremes are found on the way.
#include "server/storage/samples/row_writer.hpp"

#include <sqlite3.h>

#include <cmath>
#include <limits>
#include <string>

namespace server::storage {
namespace {

// "INSERT INTO sample (row, …) VALUES (?,…),(?,…)" for this number of rows.
std::string insert_query(std::size_t rows) {
  std::string sql = "INSERT INTO sample (row";
  std::string one_row = "(?";
  for (const station::SampleField& field : station::kSampleFields) {
    sql.append(", ").append(field.name);
    one_row += ",?";
  }
  sql += ") VALUES ";
  for (std::size_t row = 0; row < rows; ++row) sql.append(row > 0 ? "," : "").append(one_row).append(")");
  return sql;
}

}  // namespace

RowWriter::RowWriter(SQLite::Database& database)
    : database_{database},
      insert_block_{prepare_raw(database, insert_query(kBlockRows))},
      insert_one_{prepare_raw(database, insert_query(1))} {}

Extremes RowWriter::write(const std::vector<station::Sample>& samples, std::int64_t first_row) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Extremes extremes;
  extremes.min.fill(kInfinity);
  extremes.max.fill(-kInfinity);
  std::int64_t row = first_row;
  for (const station::Sample& sample : samples) {
    if (waiting_ == kBlockRows) {
      insert(insert_block_.get(), block_);
      waiting_ = 0;
    }
    block_[waiting_] = {.row = row++, .values = values_of(sample)};
    for (std::size_t channel = 0; channel < kChannels; ++channel) {
      const float value = block_[waiting_].values[channel];
      if (!std::isfinite(value)) continue;
      extremes.min[channel] = std::fmin(extremes.min[channel], value);
      extremes.max[channel] = std::fmax(extremes.max[channel], value);
    }
    ++waiting_;
  }
  return extremes;
}

void RowWriter::finish() {
  for (std::size_t at = 0; at < waiting_; ++at) insert(insert_one_.get(), {&block_[at], 1});
  waiting_ = 0;
}

void RowWriter::insert(sqlite3_stmt* statement, std::span<const Row> rows) {
  int index = 0;
  for (const Row& row : rows) {
    sqlite3_bind_int64(statement, ++index, row.row);
    for (const float value : row.values) {
      ++index;
      if (std::isfinite(value)) {
        sqlite3_bind_double(statement, index, static_cast<double>(value));
      } else {
        sqlite3_bind_null(statement, index);
      }
    }
  }
  const int result = sqlite3_step(statement);
  sqlite3_reset(statement);  // gives the same result again
  if (result != SQLITE_DONE) throw SQLite::Exception{database_.getHandle(), result};
}

}  // namespace server::storage
