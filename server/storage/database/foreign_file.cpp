// Compares with a database in memory that the same migrations have made.
#include "server/storage/database/foreign_file.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <cstdint>
#include <set>
#include <utility>

#include "server/storage/database/schema.hpp"

namespace server::storage {
namespace {

constexpr int kLongestValue = 50'000'000;  // bytes

using Schema = std::set<std::pair<std::string, std::string>>;  // "trigger 'x'" and its text

Schema schema_of(SQLite::Database& database) {
  Schema all;
  SQLite::Statement rows{database,
                         "SELECT type, name, sql FROM sqlite_schema WHERE sql IS NOT NULL"
                         " AND NOT (type = 'table' AND name IN ('sqlite_sequence', 'sqlite_stat1', 'sqlite_stat4'))"};
  while (rows.executeStep()) {
    all.emplace(fmt::format("{} '{}'", rows.getColumn(0).getString(), rows.getColumn(1).getString()),
                rows.getColumn(2).getString());
  }
  return all;
}

}  // namespace

void guard_foreign(SQLite::Database& database) {
  sqlite3* handle = database.getHandle();
  ::sqlite3_db_config(handle, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  ::sqlite3_db_config(handle, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  ::sqlite3_db_config(handle, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, nullptr);
  ::sqlite3_db_config(handle, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
  ::sqlite3_limit(handle, SQLITE_LIMIT_LENGTH, kLongestValue);
  database.exec("PRAGMA cell_size_check = ON");
}

std::optional<std::string> strange_in_schema(SQLite::Database& database) {
  const std::int64_t version = database.execAndGet("PRAGMA user_version").getInt64();
  const auto all = migrations();
  if (version < 1 || version > std::ssize(all)) return fmt::format("schema version {}", version);
  SQLite::Database made{":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE};
  for (std::int64_t n = 0; n < version; ++n) made.exec(all[static_cast<std::size_t>(n)]);
  const Schema known = schema_of(made), found = schema_of(database);
  for (const auto& one : found) {
    if (!known.contains(one)) return one.first;
  }
  for (const auto& one : known) {
    if (!found.contains(one)) return "no " + one.first;
  }
  return std::nullopt;
}

bool is_plain_table(SQLite::Database& database, const std::string& name) {
  SQLite::Statement table{database, "SELECT type FROM pragma_table_list WHERE name = ? AND schema = 'main'"};
  table.bind(1, name);
  if (!table.executeStep() || table.getColumn(0).getString() != "table") return false;
  SQLite::Statement hidden{database, "SELECT 1 FROM pragma_table_xinfo(?) WHERE hidden <> 0"};
  hidden.bind(1, name);
  return !hidden.executeStep();
}

}  // namespace server::storage
