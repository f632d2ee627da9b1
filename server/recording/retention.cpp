// By age, by size, and what to give back to the file system.
#include "server/recording/retention.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <string>

#include "server/recording/purge.hpp"

namespace server {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kLookInterval = 30s;
constexpr microseconds kStepTime = 50ms;
constexpr microseconds kPause = 10ms;            // at least, between two steps
constexpr microseconds kPauseWhenBehind = 1s;    // while commits are behind, or the write-ahead log is large
constexpr std::size_t kManyQueued = 500'000;     // samples
constexpr std::uint64_t kLargeLog = 96'000'000;  // bytes
constexpr std::int64_t kDayUs = 86'400'000'000;
constexpr std::int64_t kSliceUs = 600'000'000;  // of the recording that goes before the size is looked at again
// The database is made smaller from this part of its limit on, to that part: so that the file need not grow over it.
constexpr std::uint64_t kBeginPercent = 95;
constexpr std::uint64_t kEndPercent = 90;

struct Step {
  std::string problem;
  std::uint64_t done = 0;  // samples removed, or pages given back
  std::int64_t took_us = 0;
  PurgePosition position;
  bool finished = false;
};

// On the disk thread. A step that fails leaves everything as it was.
template <class Work>
Step measured(const Clock& clock, Work work) {
  Step step;
  const std::int64_t begun_us = clock.steady_us();
  try {
    step = work();
  } catch (const std::exception& error) {
    step.problem = error.what();
  }
  step.took_us = clock.steady_us() - begun_us;
  return step;
}

Step purge_step(SQLite::Database& database, PurgePosition position, std::int64_t older_than_us, std::size_t segments,
                std::int64_t utc_us) {
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  RetentionPlan plan{database};
  const std::vector<StoredSegment> going = plan.next(position, older_than_us, segments);
  Step step;
  step.position = position;
  step.finished = plan.finished();
  if (going.empty()) return step;
  purge(database, going, utc_us);
  transaction.commit();
  for (const StoredSegment& segment : going) step.done += segment.samples.next - segment.samples.first;
  return step;
}

std::uint64_t pragma(SQLite::Database& database, const char* name) {
  return static_cast<std::uint64_t>(database.execAndGet(fmt::format("PRAGMA {}", name)).getInt64());
}

Step shrink_step(SQLite::Database& database, std::size_t pages) {
  Step step;
  const std::uint64_t before = pragma(database, "freelist_count");
  database.exec(fmt::format("PRAGMA incremental_vacuum({})", pages));
  const std::uint64_t after = pragma(database, "freelist_count");
  step.done = before - std::min(before, after);
  step.finished = step.done == 0;
  return step;
}

}  // namespace

void StepSize::note(std::int64_t took_us) {
  if (took_us > kStepTime.count() / 2) {
    value_ = std::max<std::size_t>(value_ / 2, 1);
  } else if (took_us < kStepTime.count() / 5) {
    value_ = std::min(value_ * 2, end_);
  }
}

Retention::Retention(Clock& clock, Recorder& recorder, WorkerThread& readers, const DiskWatch& disk_watch,
                     RetentionPolicy policy)
    : clock_{clock}, recorder_{recorder}, readers_{readers}, disk_watch_{disk_watch}, policy_{policy} {}

asio::awaitable<void> Retention::run() {
  for (;;) {
    co_await clock_.sleep_for(kLookInterval);
    try {
      co_await pass();
    } catch (const SQLite::Exception& error) {  // an unreadable page is no reason to end the emergency stop
      spdlog::error("what is to be removed cannot be found: {}; looked at again in 30 s", error.what());
    }
  }
}

asio::awaitable<void> Retention::pass() {
  if (recorder_.failing()) co_return;
  if (policy_.retention_days > 0) {
    co_await purge_older_than(clock_.utc_us() - policy_.retention_days * kDayUs, 0);
  }
  if (policy_.max_database_bytes > 0) co_await purge_down_to_size();
  const bool low = disk_watch_.state() != SpaceState::ok;
  if (policy_.max_database_bytes > 0 || low) co_await shrink();
}

asio::awaitable<void> Retention::purge_older_than(std::int64_t utc_us, std::uint64_t until_used_bytes) {
  PurgePosition position;
  for (bool finished = false; !finished;) {
    auto job = [this, position, utc_us, segments = segments_.value(), now_us = clock_.utc_us()](Database& database) {
      return measured(clock_, [&] { return purge_step(database.handle(), position, utc_us, segments, now_us); });
    };
    const Step step = co_await recorder_.on_disk(std::move(job));
    if (!step.problem.empty()) {
      spdlog::warn("old samples cannot be removed now: {}", step.problem);
      co_return;
    }
    counters_.samples_purged += step.done;
    counters_.longest_step_us = std::max(counters_.longest_step_us, step.took_us);
    segments_.note(step.took_us);
    position = step.position;
    finished = step.finished;
    co_await make_room_for_commits(step.took_us);
    if (until_used_bytes > 0 && !finished) {
      const Size now = co_await size();
      finished = now.used_bytes <= until_used_bytes;
    }
  }
}

asio::awaitable<void> Retention::purge_down_to_size() {
  const std::uint64_t limit = policy_.max_database_bytes;
  Size now = co_await size();
  if (now.used_bytes > limit / 100 * kBeginPercent) {
    const std::uint64_t target = limit / 100 * kEndPercent;
    while (now.used_bytes > target) {
      const std::optional<std::int64_t> oldest = co_await oldest_us();
      if (!oldest) break;
      const std::uint64_t purged = counters_.samples_purged;
      co_await purge_older_than(*oldest + kSliceUs, target);
      if (counters_.samples_purged == purged) co_return;  // the disk fails
      now = co_await size();
    }
  }
  note_use(now.used_bytes);
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
    auto job = [this, pages = pages_.value()](Database& database) {
      return measured(clock_, [&] { return shrink_step(database.handle(), pages); });
    };
    const Step step = co_await recorder_.on_disk(std::move(job));
    counters_.pages_returned += step.done;
    counters_.longest_step_us = std::max(counters_.longest_step_us, step.took_us);
    pages_.note(step.took_us);
    if (!step.problem.empty() || step.finished) co_return;
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

asio::awaitable<std::optional<std::int64_t>> Retention::oldest_us() {
  auto look = [path = recorder_.path()] {
    SQLite::Database database = open_for_reading(path);
    return RetentionPlan{database}.oldest_us();
  };
  co_return co_await readers_.run(std::move(look));
}

asio::awaitable<void> Retention::make_room_for_commits(std::int64_t took_us) {
  const bool behind =
      recorder_.failing() || recorder_.queued_samples() > kManyQueued || recorder_.wal().bytes > kLargeLog;
  const microseconds took{took_us};
  co_await clock_.sleep_for(behind ? kPauseWhenBehind : std::max(kPause, took));
}

}  // namespace server
