// One prepared statement, stepped once per row; the extremes are found on the way.
#include "server/recording/row_writer.hpp"

#include <sqlite3.h>

#include <cmath>
#include <limits>

namespace server {
namespace {

constexpr const char* kInsertSample =
    "INSERT INTO sample (row, position_m, velocity_m_s, acceleration_m_s2, duty, impedance_mv, reference_m)"
    " VALUES (?,?,?,?,?,?,?)";

std::array<float, kChannels> channels_of(const Sample& sample) {
  return {sample.position_m, sample.velocity_m_s, sample.acceleration_m_s2,
          sample.duty,       sample.impedance_mv, sample.reference_m};
}

}  // namespace

RowWriter::RowWriter(SQLite::Database& database) : database_{database} {
  sqlite3_stmt* statement = nullptr;
  const int result =
      sqlite3_prepare_v3(database.getHandle(), kInsertSample, -1, SQLITE_PREPARE_PERSISTENT, &statement, nullptr);
  if (result != SQLITE_OK) throw SQLite::Exception{database.getHandle(), result};
  insert_.reset(statement);
}

Extremes RowWriter::write(const std::vector<Sample>& samples, std::int64_t first_row) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Extremes extremes;
  extremes.min.fill(kInfinity);
  extremes.max.fill(-kInfinity);
  std::int64_t row = first_row;
  for (const Sample& sample : samples) {
    sqlite3_bind_int64(insert_.get(), 1, row++);
    const std::array<float, kChannels> values = channels_of(sample);
    for (std::size_t channel = 0; channel < kChannels; ++channel) {
      const float value = values[channel];
      const int index = static_cast<int>(channel) + 2;
      if (!std::isfinite(value)) {
        sqlite3_bind_null(insert_.get(), index);
        continue;
      }
      sqlite3_bind_double(insert_.get(), index, static_cast<double>(value));
      extremes.min[channel] = std::fmin(extremes.min[channel], value);
      extremes.max[channel] = std::fmax(extremes.max[channel], value);
    }
    step();
  }
  return extremes;
}

void RowWriter::step() {
  const int result = sqlite3_step(insert_.get());
  sqlite3_reset(insert_.get());  // gives the same result again
  if (result != SQLITE_DONE) throw SQLite::Exception{database_.getHandle(), result};
}

}  // namespace server
