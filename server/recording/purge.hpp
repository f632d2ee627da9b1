// Removes stored segments with their rows, and notes that they were there: each of their samples is in a gap of cause
// `retention` afterwards, so that it is neither asked for again nor counted as lost.
//
// On the thread of the handle, inside a transaction of the caller.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <vector>

#include "server/recording/retention_plan.hpp"

namespace server {

// A gap of cause `retention` that touches a new one becomes one with it; the others stay as they are.
void purge(SQLite::Database& database, const std::vector<StoredSegment>& segments, std::int64_t utc_us);

}  // namespace server
