// By age, by size, and what to give back to the file system.
#include "server/storage/upkeep/retention.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <string>

#include "server/runtime/exceptions.hpp"
#include "server/storage/upkeep/event_purge.hpp"
#include "server/storage/upkeep/purge.hpp"

namespace server::storage {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kLookInterval = 30s;
constexpr microseconds kPause = 10ms;  // at least, between two steps
constexpr microseconds kPauseWhenBehind = 1s;
constexpr std::int64_t kDayUs = 86'400'000'000;
constexpr microseconds kKeepClockEvery = 10min;
constexpr const char* kNextEventRow = "SELECT coalesce(max(event_row), 0) + 1 FROM event";
// The database is made smaller from this part of its limit on, to that part: so that the file need not grow over it.
constexpr std::uint64_t kBeginPercent = 95;
constexpr std::uint64_t kEndPercent = 90;

struct Step {
  std::string problem;
  std::uint64_t done = 0;  // samples or events removed, or pages given back
  std::int64_t took_us = 0;
};

// On the disk thread. A step that fails leaves everything as it was.
template <class Work>
Step measured(const runtime::Clock& clock, Work work) {
  Step step;
  const std::int64_t begun_us = clock.steady_us();
  try {
    step.done = work();
  } catch (const std::exception& error) {
    step.problem = runtime::text_of(error);
  }
  step.took_us = clock.steady_us() - begun_us;
  return step;
}

std::uint64_t pragma(SQLite::Database& database, const char* name) {
  return static_cast<std::uint64_t>(database.execAndGet(fmt::format("PRAGMA {}", name)).getInt64());
}

}  // namespace

Retention::Retention(runtime::Clock& clock, Recorder& recorder, DatabaseReader& reader, const DiskWatch& disk_watch,
                     OutsideReferences& references, RemovalClock& removal_clock, RetentionPolicy policy)
    : clock_{clock},
      recorder_{recorder},
      reader_{reader},
      disk_watch_{disk_watch},
      references_{references},
      removal_clock_{removal_clock},
      policy_{policy},
      ages_{removal_clock, policy.retention_days * kDayUs},
      event_ages_{removal_clock, policy.event_retention_days * kDayUs} {}

asio::awaitable<void> Retention::open() {
  ages_.begin(co_await next_row());
  event_ages_.begin(co_await next_event_row());
}

asio::awaitable<void> Retention::run() {
  for (;;) {
    co_await clock_.sleep_for(kLookInterval);
    removal_clock_.look();
    try {
      co_await keep_clock();
      co_await pass();
    } catch (const SQLite::Exception& error) {  // an unreadable page is no reason to end the emergency stop
      spdlog::error("what is to be removed cannot be found: {}; looked at again in 30 s", runtime::text_of(error));
    }
  }
}

asio::awaitable<void> Retention::keep_clock() {
  const bool is_due = clock_.steady_us() - clock_stored_at_us_ >= kKeepClockEvery.count();
  if (!is_due || recorder_.failing()) co_return;
  clock_stored_at_us_ = clock_.steady_us();
  auto store = [state = removal_clock_.state()](Database& database) { store_removal_clock(database.handle(), state); };
  co_await recorder_.on_disk(std::move(store));
}

asio::awaitable<void> Retention::pass() {
  if (recorder_.failing()) co_return;
  co_await references_.sweep();
  if (policy_.retention_days > 0) {
    ages_.note(co_await next_row());
    RetentionPlan plan{ages_.limit()};
    co_await purge(std::move(plan), 0);
  }
  if (policy_.event_retention_days > 0) co_await purge_events();
  if (policy_.max_database_bytes > 0) co_await purge_down_to_size();
  const bool low = disk_watch_.state() != SpaceState::ok;
  if (policy_.max_database_bytes > 0 || low) co_await shrink();
}

asio::awaitable<bool> Retention::purge(RetentionPlan plan, std::uint64_t until_used_bytes) {
  auto look = [&plan](SQLite::Database& database) { return plan.look(database); };
  for (bool more = true; more;) more = co_await reader_.ask(look);
  while (!plan.empty()) {
    auto job = [this, &plan, now_us = clock_.utc_us()](Database& database) {
      return measured(clock_, [&] { return purge_step(database.handle(), plan, clock_, now_us); });
    };
    const Step step = co_await recorder_.on_disk(std::move(job));
    if (!step.problem.empty()) {
      spdlog::warn("old samples cannot be removed now: {}", step.problem);
      co_return false;
    }
    counters_.samples_purged += step.done;
    counters_.longest_step_us = std::max(counters_.longest_step_us, step.took_us);
    co_await make_room_for_commits(step.took_us);
    if (until_used_bytes == 0) continue;
    const Size now = co_await size();
    if (now.used_bytes <= until_used_bytes) break;
  }
  co_return true;
}

asio::awaitable<void> Retention::purge_events() {
  event_ages_.note(co_await next_event_row());
  if (clock_.steady_us() < events_due_at_us_) co_return;
  EventPurge purge{event_ages_.limit()};
  while (!purge.is_done()) {
    auto job = [this, &purge, now_us = clock_.utc_us()](Database& database) {
      return measured(clock_, [&] { return purge.step(database.handle(), clock_, now_us); });
    };
    const Step step = co_await recorder_.on_disk(std::move(job));
    if (!step.problem.empty()) {
      spdlog::warn("old events cannot be removed now: {}", step.problem);
      co_return;
    }
    counters_.events_purged += step.done;
    counters_.longest_step_us = std::max(counters_.longest_step_us, step.took_us);
    co_await make_room_for_commits(step.took_us);
  }
  events_due_at_us_ = clock_.steady_us() + kDayUs;
}

asio::awaitable<void> Retention::purge_down_to_size() {
  const std::uint64_t limit = policy_.max_database_bytes;
  Size now = co_await size();
  if (now.used_bytes > limit / 100 * kBeginPercent) {
    RetentionPlan plan{std::nullopt};
    const bool is_done = co_await purge(std::move(plan), limit / 100 * kEndPercent);
    if (!is_done) co_return;
    now = co_await size();
  }
  note_use(now.used_bytes);
}

asio::awaitable<std::int64_t> Retention::next_event_row() {
  auto query = [](SQLite::Database& database) { return database.execAndGet(kNextEventRow).getInt64(); };
  co_return co_await reader_.ask(std::move(query));
}

void Retention::note_use(std::uint64_t used_bytes) {
  const bool all_held = used_bytes > policy_.max_database_bytes;
  if (all_held && !counters_.all_held) {
    spdlog::warn(
        "the database uses {} bytes, recording.max_database_mb allows {}, and runs hold all that could go: discard "
        "runs, or allow more",
        used_bytes, policy_.max_database_bytes);
  }
  counters_.all_held = all_held;
}

// Pages that are moved are written once more, so not one more than must be.
asio::awaitable<void> Retention::shrink() {
  for (;;) {
    const Size now = co_await size();
    const bool low = disk_watch_.state() != SpaceState::ok;
    const bool too_large = policy_.max_database_bytes > 0 && now.file_bytes > policy_.max_database_bytes;
    if (now.file_bytes == now.used_bytes || !(low || too_large)) co_return;
    auto job = [this](Database& database) {
      return measured(clock_, [&] { return shrink_step(database.handle(), clock_); });
    };
    const Step step = co_await recorder_.on_disk(std::move(job));
    counters_.pages_returned += step.done;
    counters_.longest_step_us = std::max(counters_.longest_step_us, step.took_us);
    if (!step.problem.empty() || step.done == 0) co_return;
    co_await make_room_for_commits(step.took_us);
  }
}

asio::awaitable<Retention::Size> Retention::size() {
  auto job = [](Database& database) {
    const std::uint64_t page = pragma(database.handle(), "page_size");
    const std::uint64_t pages = pragma(database.handle(), "page_count");
    return Size{pages * page, (pages - pragma(database.handle(), "freelist_count")) * page};
  };
  co_return co_await recorder_.on_disk(std::move(job));
}

asio::awaitable<std::int64_t> Retention::next_row() {
  auto query = [](SQLite::Database& database) {
    return database.execAndGet("SELECT value FROM meta WHERE name = 'next_row'").getInt64();
  };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<void> Retention::make_room_for_commits(std::int64_t took_us) {
  const microseconds took{took_us};
  co_await clock_.sleep_for(recorder_.is_behind() ? kPauseWhenBehind : std::max(kPause, took));
}

}  // namespace server::storage
