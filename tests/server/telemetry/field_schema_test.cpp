// The table against the schema: each version of it has the columns that the rows say, and no other.
#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <fmt/format.h>
#include <set>

#include "server/storage/database/schema.hpp"
#include "tests/server/telemetry/field_names.hpp"

namespace server {
namespace {

using Columns = std::set<std::string>;

Columns columns_of(SQLite::Database& database, const char* table) {
  Columns columns;
  SQLite::Statement query{database, fmt::format("SELECT name FROM pragma_table_info('{}')", table)};
  while (query.executeStep()) columns.insert(query.getColumn(0).getString());
  return columns;
}

// The columns of `sample` and `segment` that hold fields.
Columns field_columns(SQLite::Database& database) {
  Columns columns = columns_of(database, "sample");
  columns.merge(columns_of(database, "segment"));
  for (const char* place :
       {"row", "boot_key", "first_seq", "last_seq", "first_row", "last_row", "first_robot_time_us", "period_us",
        "first_received_at_us", "received_at_us", "utc_offset_us", "clock_uncertainty_us", "unknown_values"}) {
    columns.erase(place);
  }
  return columns;
}

Columns expected_columns(std::int64_t version) {
  Columns columns;
  station::for_each_sample_field([&](const auto& field) {
    if (field.since_schema > version) return;
    for (const char* prefix : {"", "min_", "max_"}) columns.insert(std::string{prefix} + field.name);
  });
  station::for_each_batch_field([&](const auto& field) {
    if (field.since_schema <= version) columns.insert(field.name);
  });
  return columns;
}

TEST(TelemetryFields, AreTheColumnsOfEachVersionOfTheSchema) {
  SQLite::Database database{":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE};
  for (std::size_t version = 1; version <= storage::migrations().size(); ++version) {
    database.exec(storage::migrations()[version - 1]);
    EXPECT_EQ(field_columns(database), expected_columns(static_cast<std::int64_t>(version))) << "version " << version;
  }
}

TEST(TelemetryFields, AreInTheViewOfSamplesOfTheNewestSchema) {
  SQLite::Database database{":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE};
  for (const char* migration : storage::migrations()) database.exec(migration);
  const Columns view = columns_of(database, "run_sample");
  for (const std::string& name : sample_names()) EXPECT_TRUE(view.contains(name)) << name;
  for (const std::string& name : batch_names()) EXPECT_TRUE(view.contains(name)) << name;
}

}  // namespace
}  // namespace server
