// Documents in force, each stored once, and the sample of a boot from which they hold; the clock estimates of boots.
//
// Inside the caller's transaction, on the thread of the handle.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <string>

#include "server/station/state/station_state.hpp"

namespace server::storage {

// The key of this text; it is stored unless it is there already.
std::int64_t document_key(SQLite::Database& database, const std::string& kind, const std::string& content);

// The first of its kind in a boot is in force from sample 0 on, unless it is a change of what was not recorded. A later
// record of the same kind from the same sample on takes the place of the earlier one. Nothing is stored when the same
// text is in force already.
void store_in_force(SQLite::Database& database, std::int64_t boot_key, const station::InForceRecord& record);

void store_clock(SQLite::Database& database, std::int64_t boot_key, const station::ClockRecord& record);

}  // namespace server::storage
