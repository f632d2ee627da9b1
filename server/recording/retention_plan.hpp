// Which stored samples may go: whole segments that no run holds, that are durable with all before them, and old enough.
//
// A run holds its spans until it is discarded; an open span holds everything from its first sample on. Also kept is the
// newest segment of a boot that may go on.
// On the thread of the handle, in its transaction: what it answers is true as long as that lasts.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "server/recording/interval_set.hpp"

namespace server {

// A segment as retention sees it.
struct StoredSegment {
  std::int64_t boot_key = 0;
  Interval samples;
  std::int64_t first_row = 0;
  std::int64_t last_row = 0;
  std::int64_t received_at_us = 0;
};

// Where a walk over all recordings stands: everything before is younger, held, or gone.
struct PurgePosition {
  std::int64_t boot_key = 0;
  std::uint64_t seq = 0;
};

class RetentionPlan {
 public:
  explicit RetentionPlan(SQLite::Database& database);  // reads which spans are held

  // At most `limit` segments that arrived before `older_than_us`, in order of boot and seq, from the position on; moves
  // the position behind them. None and `finished`: there are no more.
  std::vector<StoredSegment> next(PurgePosition& position, std::int64_t older_than_us, std::size_t limit);
  bool finished() const { return finished_; }

  // When the oldest of all segments that may go had arrived.
  std::optional<std::int64_t> oldest_us();

 private:
  struct Boot {
    std::int64_t key = 0;
    std::uint64_t end = 0;  // samples from here on stay
  };
  std::vector<Boot> boots_from(std::int64_t boot_key);
  // The first segment of a boot, from a seq on, that may go whatever its age.
  std::optional<StoredSegment> first_free(const Boot& boot, std::uint64_t seq);
  std::optional<std::uint64_t> end_of_hold(const StoredSegment& segment) const;

  SQLite::Statement boots_;
  SQLite::Statement newest_;
  SQLite::Statement segment_;
  std::map<std::int64_t, std::vector<Interval>> held_;  // by boot_key
  bool finished_ = false;
};

}  // namespace server
