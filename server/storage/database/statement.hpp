// Binding and reading of the store's value types, on top of SQLiteCpp: 64-bit ids are stored as two's complement, a
// missing or non-finite number as NULL. For statements that give or take very many rows there are raw ones, without a
// shared pointer for each value.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>

namespace server::storage {

inline std::int64_t signed_id(std::uint64_t id) { return std::bit_cast<std::int64_t>(id); }
inline std::uint64_t unsigned_id(const SQLite::Column& column) {
  return std::bit_cast<std::uint64_t>(column.getInt64());
}

inline void bind_value(SQLite::Statement& statement, int index, std::int64_t value) { statement.bind(index, value); }
inline void bind_value(SQLite::Statement& statement, int index, std::uint64_t value) {
  statement.bind(index, signed_id(value));
}
inline void bind_value(SQLite::Statement& statement, int index, std::uint32_t value) { statement.bind(index, value); }
inline void bind_value(SQLite::Statement& statement, int index, const std::string& value) {
  statement.bind(index, value);
}
inline void bind_value(SQLite::Statement& statement, int index, const char* value) { statement.bind(index, value); }
inline void bind_value(SQLite::Statement& statement, int index, double value) {
  std::isfinite(value) ? statement.bind(index, value) : statement.bind(index);
}
inline void bind_value(SQLite::Statement& statement, int index, float value) {
  bind_value(statement, index, static_cast<double>(value));
}
template <class T>
void bind_value(SQLite::Statement& statement, int index, const std::optional<T>& value) {
  value ? bind_value(statement, index, *value) : statement.bind(index);
}

// Binds all values in order, before the rows are fetched.
template <class... Values>
void bind_all(SQLite::Statement& statement, const Values&... values) {
  statement.tryReset();  // gives again the error of a last execution that failed, which was reported already
  int index = 0;
  (bind_value(statement, ++index, values), ...);
}

// Runs a statement that gives no rows; returns the number of rows it changed.
template <class... Values>
int execute(SQLite::Statement& statement, const Values&... values) {
  bind_all(statement, values...);
  const int changed = statement.exec();
  statement.reset();
  return changed;
}

inline float float_or_nan(const SQLite::Column& column) {
  return column.isNull() ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(column.getDouble());
}
inline std::optional<float> optional_float(const SQLite::Column& column) {
  return column.isNull() ? std::nullopt : std::optional{static_cast<float>(column.getDouble())};
}

struct FinalizeStatement {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using RawStatement = std::unique_ptr<sqlite3_stmt, FinalizeStatement>;

[[noreturn]] inline void fail_with(SQLite::Database& database) { throw SQLite::Exception{database.getHandle()}; }

// To be used many times.
inline RawStatement prepare_raw(SQLite::Database& database, const std::string& sql) {
  sqlite3_stmt* statement = nullptr;
  const int result =
      sqlite3_prepare_v3(database.getHandle(), sql.c_str(), -1, SQLITE_PREPARE_PERSISTENT, &statement, nullptr);
  if (result != SQLITE_OK) fail_with(database);
  return RawStatement{statement};
}

// SQLite keeps integers signed: what was stored as two's complement comes back so.
inline std::uint64_t unsigned_at(sqlite3_stmt* row, int column) {
  return std::bit_cast<std::uint64_t>(std::int64_t{sqlite3_column_int64(row, column)});
}

// NULL reads as 0, so only a 0 is looked at twice.
inline float float_at(sqlite3_stmt* row, int column) {
  const double value = sqlite3_column_double(row, column);
  const bool is_null = value == 0 && sqlite3_column_type(row, column) == SQLITE_NULL;
  return is_null ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(value);
}

}  // namespace server::storage
