// Rows in the order of their table, each value as SQLite's quote() writes it, which reads back to the same bits.
#include "tests/goldens/database_text.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <fmt/format.h>

#include <vector>

namespace server {
namespace {

struct SchemaEntry {
  std::string type, name, sql;
};

// A table that SQLite makes by itself.
bool is_own(const SchemaEntry& entry) { return entry.name.starts_with("sqlite_"); }

std::vector<SchemaEntry> schema_of(SQLite::Database& database) {
  std::vector<SchemaEntry> entries;
  SQLite::Statement query{database, "SELECT type, name, sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY rowid"};
  while (query.executeStep()) entries.push_back({query.getColumn(0), query.getColumn(1), query.getColumn(2)});
  return entries;
}

std::string rows_of(SQLite::Database& database, const std::string& table) {
  std::string columns;
  SQLite::Statement names{database, fmt::format("SELECT name FROM pragma_table_info('{}')", table)};
  while (names.executeStep()) {
    columns += fmt::format("{}quote(\"{}\")", columns.empty() ? "" : " || ',' || ", names.getColumn(0).getString());
  }
  std::string text;
  SQLite::Statement rows{database, fmt::format("SELECT {} FROM \"{}\"", columns, table)};
  while (rows.executeStep()) {
    text += fmt::format("INSERT INTO {} VALUES({});\n", table, rows.getColumn(0).getString());
  }
  return text;
}

}  // namespace

std::string database_text(const std::filesystem::path& path) {
  SQLite::Database database{path.string(), SQLite::OPEN_READONLY};
  std::string text = fmt::format("PRAGMA application_id = {};\nPRAGMA user_version = {};\nBEGIN;\n",
                                 database.execAndGet("PRAGMA application_id").getInt64(),
                                 database.execAndGet("PRAGMA user_version").getInt64());
  const std::vector<SchemaEntry> entries = schema_of(database);
  for (const SchemaEntry& entry : entries) {
    if (entry.type == "table" && !is_own(entry)) text += entry.sql + ";\n" + rows_of(database, entry.name);
  }
  for (const SchemaEntry& entry : entries) {  // SQLite made and filled it meanwhile
    if (is_own(entry)) text += "DELETE FROM " + entry.name + ";\n" + rows_of(database, entry.name);
  }
  for (const SchemaEntry& entry : entries) {
    if (entry.type != "table") text += entry.sql + ";\n";
  }
  return text + "COMMIT;\n";
}

std::string schema_text(const std::filesystem::path& path) {
  SQLite::Database database{path.string(), SQLite::OPEN_READONLY};
  std::string text;
  for (const SchemaEntry& entry : schema_of(database)) text += entry.sql + ";\n";
  return text;
}

void make_database_of_text(const std::filesystem::path& path, const std::string& text) {
  SQLite::Database database{path.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE};
  database.exec("PRAGMA auto_vacuum = INCREMENTAL");
  database.exec(text);
}

}  // namespace server
