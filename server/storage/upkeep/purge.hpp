// Removes stored segments with their rows, and records that they existed: each of their samples is in a gap of cause
// `retention` afterwards, so that it is neither asked for again nor counted as lost. Gives free pages back.
//
// On the disk thread.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>

#include "server/runtime/clock.hpp"
#include "server/storage/samples/interval_set.hpp"
#include "server/storage/upkeep/retention_plan.hpp"

namespace server::storage {

// After this no step of retention begins another slice of its work; a slice and the commit take far less than the rest
// of the 50 ms that a step may take.
inline constexpr microseconds kStepTime{10'000};

// Returns how many samples it removed. One transaction: walks along the plan in slices of a few segments and looks at
// the clock between them. A gap of cause `retention` that touches a new one becomes one with it; the others stay as
// they are. When it throws, the database is as it was, and the plan must not be used any more.
std::uint64_t purge_step(SQLite::Database& database, RetentionPlan& plan, const runtime::Clock& clock,
                         std::int64_t utc_us);

// Makes the file shorter by free pages, in slices of a few, with a look at the clock between them. Returns how many; 0
// when none is left. One transaction.
std::uint64_t shrink_step(SQLite::Database& database, const runtime::Clock& clock);

// Gaps of cause `retention`, of samples or of events: one that touches a new one becomes one with it. In the caller's
// transaction.
struct GapTable {
  const char* name;
  const char* first;  // columns
  const char* last;
};

class RetentionGaps {
 public:
  RetentionGaps(SQLite::Database& database, const GapTable& table);

  void add(std::int64_t boot_key, Interval purged, std::int64_t utc_us);

 private:
  SQLite::Statement before_, after_, remove_, add_;
};

}  // namespace server::storage
