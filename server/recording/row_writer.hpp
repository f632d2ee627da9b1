// Writes the rows of samples, the hottest statement of the station: raw SQLite, nothing allocated per sample.
//
// Disk thread only, inside the caller's transaction. Uses the database, which outlives it. Throws SQLite::Exception.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <array>
#include <cstdint>
#include <vector>

#include "server/recording/sample_scanner.hpp"
#include "server/station/station_state.hpp"

namespace server {

// The smallest and largest finite value of each channel; infinite (stored as NULL) when there is none.
struct Extremes {
  std::array<float, kChannels> min{};  // by Channel
  std::array<float, kChannels> max{};
};

class RowWriter {
 public:
  explicit RowWriter(SQLite::Database& database);

  // The rows get consecutive numbers.
  Extremes write(const std::vector<Sample>& samples, std::int64_t first_row);

 private:
  void step();

  SQLite::Database& database_;
  RawStatement insert_;
};

}  // namespace server
