// Writes the rows of samples, the hottest statement of the station: raw SQLite, nothing allocated per sample, many rows
// with each step, since a statement that ends costs as much as a row.
//
// Disk thread only, inside the caller's transaction. Uses the database, which outlives it. Throws SQLite::Exception.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/station/state/station_state.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/samples/channels.hpp"

namespace server::storage {

// The smallest and largest finite value of each channel; infinite (stored as NULL) when there is none.
struct Extremes {
  std::array<float, kChannels> min{};  // by Channel
  std::array<float, kChannels> max{};
};

class RowWriter {
 public:
  explicit RowWriter(SQLite::Database& database);

  // What an earlier transaction left behind, because it failed, is forgotten.
  void begin() { waiting_ = 0; }

  // The rows get consecutive numbers. They are in the table once finish() has returned.
  Extremes write(const std::vector<station::Sample>& samples, std::int64_t first_row);
  void finish();

 private:
  static constexpr std::size_t kBlockRows = 50;

  struct Row {
    std::int64_t row = 0;
    std::array<float, kChannels> values{};
  };

  void insert(sqlite3_stmt* statement, std::span<const Row> rows);

  SQLite::Database& database_;
  RawStatement insert_block_;
  RawStatement insert_one_;
  std::array<Row, kBlockRows> block_;
  std::size_t waiting_ = 0;  // of block_
};

}  // namespace server::storage
