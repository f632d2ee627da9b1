// Removes stored events that are old enough, and records that they existed: each event of a robot is in a gap of cause
// `retention` afterwards, and an entry of the audit says how many went, and from when to when they had arrived.
//
// Kept are events that a run holds, until it is discarded: those of a robot by its samples, those of the station by the
// time of the run. Kept are also a boot's last event of its latch, and what is not known to be durable with all before.
//
// On the disk thread.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>

#include "server/runtime/clock.hpp"
#include "server/storage/upkeep/sample_ages.hpp"

namespace server::storage {

class EventPurge {
 public:
  // In the order of their rows, to the first that is too young.
  explicit EventPurge(AgeLimit limit) : limit_{limit} {}

  bool is_done() const { return is_done_; }

  // Returns how many it removed. One transaction, with the entry of the audit in it; looks at some hundred rows at a
  // time, and at the clock between them. When it throws, the database is as it was, and the purge must not be used any
  // more.
  std::uint64_t step(SQLite::Database& database, const runtime::Clock& clock, std::int64_t utc_us);

 private:
  AgeLimit limit_;
  std::int64_t after_row_ = 0;  // that was looked at last
  bool is_done_ = false;
};

}  // namespace server::storage
