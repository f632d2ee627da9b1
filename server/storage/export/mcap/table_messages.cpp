// SQLite's types decide how a value is written.
#include "server/storage/export/mcap/table_messages.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/json_text.hpp"
#include "base/number_text.hpp"
#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr int kTimes = 2;  // columns before those of the table
constexpr int kSliceRows = 2'000;

// Of a value's type, "integer", or of a column's, "INT".
const char* json_type(const std::string& sqlite_type) {
  if (sqlite_type == "integer" || sqlite_type == "INT") return "integer";
  return sqlite_type == "real" || sqlite_type == "REAL" ? "number" : "string";
}

// By the first value, since a column of a view need not have a type; where there is none by the column's.
std::string schema_of(SQLite::Database& database, const TableChannel& what) {
  nlohmann::json properties = nlohmann::json::object();
  SQLite::Statement columns{database, fmt::format("SELECT name, type FROM pragma_table_info('{}')", what.table)};
  while (columns.executeStep()) {
    const std::string name = columns.getColumn(0).getString();
    SQLite::Statement type{database, fmt::format("SELECT coalesce((SELECT typeof(\"{0}\") FROM \"{1}\" WHERE \"{0}\" IS"
                                                 " NOT NULL LIMIT 1), ?)",
                                                 name, what.table)};
    bind_all(type, columns.getColumn(1).getString());
    type.executeStep();
    properties[name] = {{"type", json_type(type.getColumn(0).getString())}};
  }
  return base::dump({{"type", "object"}, {"properties", properties}});
}

void append_value(std::string& out, const SQLite::Column& value) {
  if (value.isInteger()) return base::append_number(out, value.getInt64());
  if (!value.isFloat()) {
    out += base::dump(value.getString());
    return;
  }
  const double number = value.getDouble();
  const auto single = static_cast<float>(number);
  if (static_cast<double>(single) == number) return base::append_float(out, single, "");
  char digits[32];
  out.append(digits, std::to_chars(digits, digits + sizeof digits, number).ptr);
}

void append_row(std::string& out, SQLite::Statement& row) {
  char separator = '{';
  for (int index = kTimes; index < row.getColumnCount(); ++index) {
    const SQLite::Column value = row.getColumn(index);
    if (value.isNull() || value.isBlob()) continue;
    out += separator;
    out += fmt::format("\"{}\":", value.getName());
    append_value(out, value);
    separator = ',';
  }
  out += separator == '{' ? "{}" : "}";
}

}  // namespace

TableMessages::TableMessages(SQLite::Database& database, McapFile& file, const TableChannel& what)
    : file_{file},
      rows_{database,
            fmt::format("SELECT {}, {}, * FROM {} ORDER BY 1", what.log_time_us, what.publish_time_us, what.table)},
      channel_{file.add_channel(what.topic, what.schema_name, schema_of(database, what))} {}

bool TableMessages::advance() {
  for (int row = 0; row < kSliceRows; ++row) {
    if (!rows_.executeStep()) return false;
    const std::uint64_t log_time_ns = nanoseconds(rows_.getColumn(0).getInt64());
    append_row(file_.begin_message({channel_, sequence_++, log_time_ns, nanoseconds(rows_.getColumn(1).getInt64())}),
               rows_);
    file_.end_message();
  }
  return true;
}

}  // namespace server::storage
