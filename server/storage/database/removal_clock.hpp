// The time by which things grow old enough to be removed.
//
// A wrong clock removes nothing: within a start time goes on with what has passed, whatever the computer's clock is set
// to; backward that is followed at once. A start goes by the computer's clock, unless that is ahead of where time was
// by more than kDoubtful. What is ahead by more than that, also by being set, is doubted: what would be removed for its
// age waits until the clock has stood by it for kStandsBy of running, over restarts, or an administrator has said that
// it is right. A clock that is set again meanwhile, or that is far from where it stood at the last stop, stands by it
// anew; time in which the computer slept is no running. Limits by space know no age.
//
// Loop thread; reading and storing on the disk thread.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>

#include "server/runtime/clock.hpp"

namespace server::storage {

class RemovalClock {
 public:
  static constexpr microseconds kDoubtful{std::chrono::days{1}}, kStandsBy{std::chrono::days{1}};

  // What outlives a start.
  struct State {
    std::int64_t utc_us = 0;          // 0: nothing is known of earlier starts
    std::int64_t doubted_for_us = 0;  // running
    std::int64_t seen_utc_us = 0;     // of the computer's clock, when this was noted
    bool operator==(const State&) const = default;
  };

  explicit RemovalClock(const runtime::Clock& clock) : clock_{clock} {}

  void begin(const State& earlier);
  void look();    // from time to time
  void accept();  // an administrator says that the clock is right

  std::int64_t utc_us() const;  // never beyond the computer's clock
  std::int64_t steady_us() const { return clock_.steady_us(); }
  bool is_doubted() const { return is_doubted_; }
  State state() const { return {utc_us(), doubted_for_us_, clock_.utc_us()}; }

 private:
  void believe(std::int64_t utc_us);

  const runtime::Clock& clock_;
  std::int64_t believed_utc_us_ = 0;  // at looked_at_us_
  std::int64_t looked_at_us_ = 0;     // steady
  std::int64_t seen_utc_us_ = 0;      // of the computer, then
  std::int64_t doubted_for_us_ = 0;
  bool is_doubted_ = false;
};

// What an earlier start has stored, or the time of the newest entry of the audit.
RemovalClock::State read_removal_clock(SQLite::Database& database);
void store_removal_clock(SQLite::Database& database, const RemovalClock::State& state);

}  // namespace server::storage
