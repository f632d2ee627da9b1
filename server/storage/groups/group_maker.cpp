// boot.grouped_next_seq says how far the groups of a boot are made, in the transaction that made them.
#include "server/storage/groups/group_maker.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <vector>

#include "server/runtime/exceptions.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/groups/segment_groups.hpp"

namespace server::storage {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kLookInterval = 1min;
constexpr microseconds kStepTime = 10ms;  // after this no step begins another window, which takes some 0.1 ms
constexpr microseconds kPause = 10ms;     // at least, between two steps
constexpr microseconds kPauseWhenBehind = 1s;
constexpr std::int64_t kBootsAtOnce = 2000;

struct Found {
  std::vector<std::int64_t> boots;  // that have a window to make
  std::int64_t last_boot_key = 0;   // that was looked at
  bool is_end = true;
};

Found find_boots(SQLite::Database& database, std::int64_t after_boot_key) {
  SQLite::Statement query{database,
                          "SELECT boot_key, max(durable_next_seq, coalesce(ended_next_seq, 0)) - grouped_next_seq"
                          " FROM boot WHERE boot_key > ? ORDER BY boot_key LIMIT ?"};
  bind_all(query, after_boot_key, kBootsAtOnce);
  Found found;
  std::int64_t read = 0;
  for (; query.executeStep(); ++read) {
    found.last_boot_key = query.getColumn(0).getInt64();
    const bool is_due = query.getColumn(1).getInt64() >= static_cast<std::int64_t>(kGroupNumbers);
    if (is_due) found.boots.push_back(found.last_boot_key);
  }
  found.is_end = read < kBootsAtOnce;
  return found;
}

// Where the first segment from this number on begins; the end if there is none.
std::uint64_t next_stored(SQLite::Database& database, std::int64_t boot_key, Interval range) {
  SQLite::Statement query{database,
                          "SELECT first_seq FROM segment WHERE boot_key = ? AND first_seq >= ? AND first_seq < ?"
                          " ORDER BY first_seq LIMIT 1"};
  bind_all(query, boot_key, range.first, range.next);
  return query.executeStep() ? unsigned_id(query.getColumn(0)) : range.next;
}

// One step; returns whether there is more to do.
bool make_some(SQLite::Database& database, std::int64_t boot_key, const runtime::Clock& clock) {
  const std::int64_t end_us = clock.steady_us() + kStepTime.count();
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement boot{database,
                         "SELECT grouped_next_seq, max(durable_next_seq, coalesce(ended_next_seq, 0)) FROM boot WHERE"
                         " boot_key = ?"};
  bind_all(boot, boot_key);
  if (!boot.executeStep()) return false;
  std::uint64_t next = unsigned_id(boot.getColumn(0));
  const std::uint64_t settled_next = unsigned_id(boot.getColumn(1));
  boot.reset();
  bool more = true;
  do {
    const std::uint64_t stored = next_stored(database, boot_key, {next, settled_next});
    const Interval window = group_window(boot_key, stored);
    more = window.next <= settled_next;
    if (more) make_group(database, boot_key, window);
    next = std::max(next, more ? window.next : window.first);
  } while (more && clock.steady_us() < end_us);
  SQLite::Statement advance{database, "UPDATE boot SET grouped_next_seq = ? WHERE boot_key = ?"};
  execute(advance, next, boot_key);
  transaction.commit();
  return more;
}

}  // namespace

asio::awaitable<void> GroupMaker::run() {
  for (;;) {
    try {
      co_await pass();
    } catch (const SQLite::Exception& error) {
      spdlog::warn("groups of segments cannot be made now: {}; tried again in a minute", runtime::text_of(error));
    }
    co_await clock_.sleep_for(kLookInterval);
  }
}

asio::awaitable<void> GroupMaker::pass() {
  std::int64_t boot_key = 0;
  for (bool more = true; more;) {
    auto look = [boot_key](SQLite::Database& database) { return find_boots(database, boot_key); };
    const Found found = co_await reader_.ask(std::move(look));
    for (const std::int64_t boot : found.boots) co_await make_groups(boot);
    boot_key = found.last_boot_key;
    more = !found.is_end;
  }
}

asio::awaitable<void> GroupMaker::make_groups(std::int64_t boot_key) {
  for (bool more = true; more;) {
    const std::int64_t begun_us = clock_.steady_us();
    auto step = [this, boot_key](Database& database) { return make_some(database.handle(), boot_key, clock_); };
    more = co_await recorder_.on_disk(std::move(step));
    const microseconds took{clock_.steady_us() - begun_us};
    longest_step_us_ = std::max(longest_step_us_, std::int64_t{took.count()});
    co_await clock_.sleep_for(recorder_.is_behind() ? kPauseWhenBehind : std::max(kPause, took));
  }
}

}  // namespace server::storage
