// The tables that storage/export/run_file writes.
#include "server/analysis/capsule/capsule_samples.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <fmt/format.h>
#include <sqlite3.h>

#include "server/runtime/exceptions.hpp"
#include "server/storage/database/foreign_file.hpp"
#include "server/storage/export/run_file.hpp"
#include "server/storage/query/run_reader.hpp"

namespace server::analysis {
namespace {

Result<CapsuleSamples> read_all(SQLite::Database& database, std::size_t limit) {
  if (database.execAndGet("PRAGMA application_id").getInt64() != storage::kRunFileApplicationId) {
    return fail(ErrorCode::invalid, "samples.sqlite is not the export of a run");
  }
  for (const char* table : {"sample", "outside_reference", "outside_position"}) {
    if (database.tableExists(table) && !storage::is_plain_table(database, table)) {
      return fail(ErrorCode::invalid, fmt::format("cannot read samples.sqlite: {} is no plain table", table));
    }
  }
  auto samples = storage::read_exported_run(database, limit);
  if (!samples) return std::unexpected{samples.error()};
  return CapsuleSamples{std::move(*samples), storage::read_exported_reference(database)};
}

}  // namespace

Result<CapsuleSamples> read_capsule_samples(std::string& file, std::size_t limit) {
  try {
    SQLite::Database database{":memory:", SQLite::OPEN_READWRITE};
    storage::guard_foreign(database);
    database.exec("PRAGMA temp_store = MEMORY");
    auto* const bytes = reinterpret_cast<unsigned char*>(file.data());
    const auto size = static_cast<sqlite3_int64>(file.size());
    ::sqlite3_deserialize(database.getHandle(), "main", bytes, size, size, SQLITE_DESERIALIZE_READONLY);
    return read_all(database, limit);
  } catch (const SQLite::Exception& error) {
    return fail(ErrorCode::invalid, fmt::format("cannot read samples.sqlite: {}", runtime::text_of(error)));
  }
}

}  // namespace server::analysis
