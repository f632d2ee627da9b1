// Compares the computer's clock with the time that has passed.
#include "server/storage/database/removal_clock.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdlib>

#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr double kUsOfADay = 86'400e6;
constexpr microseconds kStillTheSame{std::chrono::minutes{5}};  // and the longest that passes between two looks

std::int64_t meta(SQLite::Database& database, const char* name) {
  SQLite::Statement query{database, "SELECT value FROM meta WHERE name = ?"};
  query.bind(1, name);
  return query.executeStep() ? query.getColumn(0).getInt64() : 0;
}

}  // namespace

void RemovalClock::begin(const State& earlier) {
  looked_at_us_ = clock_.steady_us();
  seen_utc_us_ = clock_.utc_us();
  believed_utc_us_ = earlier.utc_us == 0 ? seen_utc_us_ : earlier.utc_us;
  const std::int64_t since_us = seen_utc_us_ - earlier.seen_utc_us;  // the station was off
  const bool is_the_same = since_us >= 0 && since_us <= kDoubtful.count();
  doubted_for_us_ = is_the_same ? earlier.doubted_for_us : 0;
  if (seen_utc_us_ - believed_utc_us_ <= kDoubtful.count()) return believe(seen_utc_us_);
  look();
}

void RemovalClock::look() {
  const std::int64_t passed_us = clock_.steady_us() - looked_at_us_, now_us = clock_.utc_us();
  const std::int64_t jumped_us = now_us - seen_utc_us_ - passed_us;
  looked_at_us_ += passed_us;
  believed_utc_us_ += passed_us;
  seen_utc_us_ = now_us;
  const std::int64_t ahead_us = now_us - believed_utc_us_;
  if (ahead_us <= kDoubtful.count()) return believe(std::min(now_us, believed_utc_us_));
  if (!is_doubted_) {
    spdlog::warn(
        "the clock of this computer has gone forward by {:.1f} days: what its age would remove stays until the clock "
        "has stood by that for 24 h of running, or an administrator accepts it (rheonaut's API, "
        "recording/clock/accept)",
        static_cast<double>(ahead_us) / kUsOfADay);
  }
  is_doubted_ = true;
  const bool is_set_again = std::abs(jumped_us) > kStillTheSame.count();
  doubted_for_us_ = is_set_again ? 0 : doubted_for_us_ + std::min(passed_us, std::int64_t{kStillTheSame.count()});
  if (doubted_for_us_ >= kStandsBy.count()) believe(now_us);
}

void RemovalClock::accept() { believe(clock_.utc_us()); }

void RemovalClock::believe(std::int64_t utc_us) {
  believed_utc_us_ = utc_us;
  doubted_for_us_ = 0;
  is_doubted_ = false;
}

std::int64_t RemovalClock::utc_us() const {
  return std::min(clock_.utc_us(), believed_utc_us_ + clock_.steady_us() - looked_at_us_);
}

RemovalClock::State read_removal_clock(SQLite::Database& database) {
  RemovalClock::State state{meta(database, "removal_utc_us"), meta(database, "clock_doubted_for_us"),
                            meta(database, "clock_seen_utc_us")};
  if (state.utc_us != 0) return state;
  SQLite::Statement newest{database, "SELECT at_us FROM audit ORDER BY entry DESC LIMIT 1"};
  if (newest.executeStep()) state.utc_us = newest.getColumn(0).getInt64();
  return state;
}

void store_removal_clock(SQLite::Database& database, const RemovalClock::State& state) {
  SQLite::Statement set{database, "INSERT OR REPLACE INTO meta (name, value) VALUES (?, ?)"};
  execute(set, "removal_utc_us", state.utc_us);
  execute(set, "clock_doubted_for_us", state.doubted_for_us);
  execute(set, "clock_seen_utc_us", state.seen_utc_us);
}

}  // namespace server::storage
