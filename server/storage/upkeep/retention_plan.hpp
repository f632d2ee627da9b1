// Selects the stored samples to remove, the oldest first: whole segments that no run holds, that are durable with all
// before them, and old enough.
//
// A run holds its spans until it is discarded; an open span holds everything from its first sample on. Also kept is the
// newest segment of a boot that may go on.
//
// A plan is made once, on a reader and in short questions: the parts of boots that are free. Then it is walked on the
// disk thread in steps. What has come to be held since is found there: a run that was made later has a larger number,
// and an open one has an open span. Not used by two threads at once.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <queue>
#include <vector>

#include "server/storage/samples/interval_set.hpp"
#include "server/storage/upkeep/sample_ages.hpp"

namespace server::storage {

// A segment as retention sees it.
struct StoredSegment {
  std::int64_t boot_key = 0;
  Interval samples;
  std::int64_t first_row = 0;
  std::int64_t last_row = 0;
  std::int64_t received_at_us = 0;
};

class RetentionPlan {
 public:
  // Without a limit everything is old enough.
  explicit RetentionPlan(std::optional<AgeLimit> limit) : limit_{limit} {}

  // Looks at some more boots; true: there are more.
  bool look(SQLite::Database& database);

  bool empty() const { return parts_.empty(); }

  // A walk along the plan inside one transaction, which must be a writing one.
  class Step {
   public:
    Step(RetentionPlan& plan, SQLite::Database& database);
    // At most `limit` segments of one boot, which then are off the plan; not when it is empty. May be none.
    std::vector<StoredSegment> next(std::size_t limit);

   private:
    bool is_free(std::int64_t boot_key, std::uint64_t next_seq, bool has_ended);

    RetentionPlan& plan_;
    SQLite::Statement boot_;
    SQLite::Statement segments_;
  };

 private:
  // Consecutive samples of a boot that may go, as far as they are old enough.
  struct Part {
    std::int64_t boot_key = 0;
    Interval samples;
    bool boot_has_ended = false;
    std::int64_t first_row = 0;  // of the first segment: rows are numbered in the order of their arrival
    bool operator>(const Part& other) const { return first_row > other.first_row; }
  };
  using HeldSamples = std::map<std::int64_t, IntervalSet>;  // by boot_key

  void read_held(SQLite::Database& database);
  void read_boots(SQLite::Database& database);
  void read_first_segments(SQLite::Database& database);
  bool may_go(const StoredSegment& segment, const Part& part) const;

  std::optional<AgeLimit> limit_;
  std::optional<std::int64_t> newest_run_;  // of the runs whose spans are in held_
  HeldSamples held_;                        // while looking; then what later runs hold
  std::int64_t boot_key_ = 0;               // of the last boot looked at
  bool all_boots_read_ = false;
  std::vector<Part> unread_;  // whose first segment has not been looked for
  std::priority_queue<Part, std::vector<Part>, std::greater<>> parts_;
};

}  // namespace server::storage
