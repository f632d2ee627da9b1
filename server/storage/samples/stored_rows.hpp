// From stored rows back to the station's values, and the queries over commands and events that give them.
//
// On the thread that owns the handle.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "server/station/state/station_state.hpp"
#include "server/station/state/unknown_values.hpp"
#include "server/storage/database/database.hpp"

namespace server::storage {

// The enumerator whose text() this is; of "unknown" kNumberNotKept (unknown_values.hpp), of any other text 0.
template <class Enumerator>
Enumerator enumerator_from(std::string_view text) {
  constexpr int kMostEnumerators = 256;
  for (int number = 0; number < kMostEnumerators; ++number) {
    const auto value = static_cast<Enumerator>(number);
    if (!station::is_unknown(value) && text == protocol::text(value)) return value;
  }
  return static_cast<Enumerator>(text == "unknown" ? station::kNumberNotKept : 0);
}

// The column of a field in a database of this version of the schema, as SQL.
template <class Field>
const char* column_or_null(const Field& field, std::int64_t version) {
  return field.since_schema <= version ? field.name : "NULL";
}

// Puts the numbers of a column unknown_values in their place.
void set_unknown(station::SampleContext& context, const std::string& unknown_values);

// `condition` is SQL that follows SELECT … FROM; its `?` are bound by the caller.
std::string select_commands(const char* condition);
std::string select_events(const char* condition);
station::CommandRecord command_from(SQLite::Statement& row);
station::RobotEvent event_from(SQLite::Statement& row);
// Columns of them. An audit entry is NULL where the command is older than the audit.
inline constexpr int kCommandId = 0, kCommandSubmittedAt = 8, kCommandAuditEntry = 18;
inline constexpr int kEventReceivedAt = 13, kEventRow = 17;

// Emergency stops that no robot has acknowledged, oldest first.
std::vector<station::CommandRecord> pending_stops(Database& database);

// Commands other than emergency stops that were on their way when the station stopped: nobody follows them any more. Of
// renewals of a lease that went on then, it is stored that their number is not known.
void end_unfinished_commands(Database& database, std::int64_t utc_us);

}  // namespace server::storage
