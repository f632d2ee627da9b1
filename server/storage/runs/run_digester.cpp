// One run at a time, page by page.
#include "server/storage/runs/run_digester.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <tuple>
#include <utility>

#include "server/runtime/exceptions.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/runs/run_queries.hpp"

namespace server::storage {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr std::uint64_t kPageSamples = 20'000;
constexpr microseconds kFirstDelay = 250ms;
constexpr microseconds kLongestDelay = 60s;
constexpr microseconds kFindPatience = 3s;
constexpr microseconds kFindLook = 20ms;

// A page of a digest, or why there can be none.
struct Page {
  DigestComputation computation{{}};
  DigestComputation::Progress progress = DigestComputation::Progress::more;
  std::string problem;
};

Page next_page(SQLite::Database& database, RunId run, std::optional<DigestComputation> begun) {
  Page page;
  try {
    const SQLite::Transaction moment{database};
    page.computation = begun ? std::move(*begun) : DigestComputation{read_digest_spans(database, run)};
    page.progress = page.computation.advance(database, kPageSamples);
  } catch (const std::exception& error) {  // the file is damaged or the disk fails: the station goes on without
    page.problem = runtime::text_of(error);
  }
  return page;
}

std::vector<RunId> runs_with(SQLite::Database& database, const char* condition) {
  std::vector<RunId> runs;
  try {
    SQLite::Statement rows{database, fmt::format("SELECT run_id FROM run LEFT JOIN run_certificate USING (run_id)"
                                                 " WHERE state IN ('ended', 'interrupted') AND {}",
                                                 condition)};
    while (rows.executeStep()) runs.push_back(rows.getColumn(0).getInt64());
  } catch (const SQLite::Exception& error) {
    spdlog::error("runs without a digest cannot be looked for: {}", runtime::text_of(error));
  }
  return runs;
}

// A page of the counts of a run, or why they cannot be read.
struct CountedPage {
  HeadTally tally;
  bool has_more = false;
  std::string problem{};
};

template <class Tally>
CountedPage next_counted(SQLite::Database& database, Tally tally) {
  CountedPage page;
  try {
    const SQLite::Transaction moment{database};
    page.tally = tally(database);
    page.has_more = page.tally.advance(database);
  } catch (const std::exception& error) {  // as in next_page()
    page.problem = runtime::text_of(error);
  }
  return page;
}

// Runs that ended before the last stop of the station, or under a version that made no digests.
std::vector<RunId> runs_without_digest(SQLite::Database& database) { return runs_with(database, "format IS NULL"); }

// Runs with the digest of a version that did not count what the robot missed; the newest comes last.
std::vector<RunId> runs_not_counted(SQLite::Database& database) {
  return runs_with(database, "format IS NOT NULL AND missed_ticks IS NULL ORDER BY run_id");
}

}  // namespace

RunDigester::RunDigester(runtime::Clock& clock, Recorder& recorder, DatabaseReader& reader)
    : clock_{clock}, recorder_{recorder}, reader_{reader}, added_{recorder.loop()} {}

asio::awaitable<void> RunDigester::run() {
  const std::vector<RunId> runs = co_await reader_.ask(runs_without_digest);
  for (const RunId run : runs) add(run);
  std::vector<RunId> not_counted = co_await reader_.ask(runs_not_counted);
  for (;;) {
    const auto due = std::ranges::min_element(pending_, {}, [](const auto& entry) { return entry.second.due_us; });
    if (due != pending_.end() && due->second.due_us <= clock_.steady_us()) {
      co_await look_at(due->first);
    } else if (!not_counted.empty()) {  // while nothing else is to be done
      const RunId run = not_counted.back();
      not_counted.pop_back();
      co_await count_missed_ticks(run);
    } else {
      co_await wait_until_due();
    }
  }
}

asio::awaitable<void> RunDigester::count_missed_ticks(RunId run) {
  Result<RunDigest> counted = co_await count(run);
  if (!counted) {
    spdlog::error("the ticks that the robot missed in run {} cannot be counted: {}", run, counted.error().detail);
    co_return;
  }
  auto job = [run, counts = std::move(*counted)](Database& database) {
    try {
      write_missed_ticks(database.handle(), run, counts);
    } catch (const SQLite::Exception&) {  // as in store(); counted after the next start
    }
    return true;
  };
  co_await recorder_.on_disk(std::move(job));
}

void RunDigester::add(RunId run) {
  Pending& pending = pending_[run];
  pending.due_us = clock_.steady_us();
  pending.delay_us = kFirstDelay.count();
  added_.notify();
}

asio::awaitable<Result<CurrentDigest>> RunDigester::find(RunId run) {
  auto query = [run](SQLite::Database& database) { return read_run_state(database, run); };
  const std::optional<RunState> state = co_await reader_.ask(std::move(query));
  if (!state) co_return fail(ErrorCode::not_found, fmt::format("there is no run {}", run));
  if (*state == RunState::open) {
    co_return fail(ErrorCode::conflict, fmt::format("run {} is open; a certificate is made when it has ended", run));
  }
  std::optional<RunDigest> made = co_await stored(run);
  if (!made && *state == RunState::discarded) {
    co_return fail(ErrorCode::conflict, fmt::format("run {} was discarded before it had a certificate", run));
  }
  if (!made) {
    add(run);
    const std::uint64_t looks = pending_[run].looks;
    const std::int64_t deadline_us = clock_.steady_us() + kFindPatience.count();
    const auto is_looked_at = [&] {
      const auto entry = pending_.find(run);
      return entry == pending_.end() || entry->second.looks > looks;
    };
    while (!is_looked_at() && clock_.steady_us() < deadline_us) co_await clock_.sleep_for(kFindLook);
    made = co_await stored(run);
  }
  if (made) co_return CurrentDigest{std::move(*made), true};
  Result<RunDigest> counts = co_await count(run);
  if (!counts) co_return std::unexpected{counts.error()};
  counts->made_at_us = clock_.utc_us();
  co_return CurrentDigest{std::move(*counts), false};
}

asio::awaitable<Result<RunDigest>> RunDigester::count(RunId run) {
  CountedPage page;
  auto begin = [run](SQLite::Database& database) {
    return next_counted(database, [run](SQLite::Database& of) { return HeadTally{read_digest_spans(of, run)}; });
  };
  page = co_await reader_.ask(std::move(begin));
  while (page.problem.empty() && page.has_more) {
    auto next = [tally = std::move(page.tally)](SQLite::Database& database) mutable {
      return next_counted(database, [&tally](SQLite::Database&) { return std::move(tally); });
    };
    page = co_await reader_.ask(std::move(next));
  }
  if (!page.problem.empty()) co_return fail(ErrorCode::unavailable, page.problem);
  co_return page.tally.counts();
}

asio::awaitable<void> RunDigester::wait_until_due() {
  if (pending_.empty()) {
    co_await added_.wait();
    co_return;
  }
  std::int64_t due_us = pending_.begin()->second.due_us;
  for (const auto& [run, pending] : pending_) due_us = std::min(due_us, pending.due_us);
  if (due_us <= clock_.steady_us()) co_return;
  co_await added_.wait_until(clock_, due_us);
}

asio::awaitable<void> RunDigester::look_at(RunId run) {
  std::optional<DigestComputation> begun = std::exchange(pending_[run].begun, std::nullopt);
  Page page;
  do {
    auto query = [run, begun = std::move(begun)](SQLite::Database& database) mutable {
      return next_page(database, run, std::move(begun));
    };
    page = co_await reader_.ask(std::move(query));
    begun = std::move(page.computation);
  } while (page.problem.empty() && page.progress == DigestComputation::Progress::more);

  if (page.problem.empty() && page.progress == DigestComputation::Progress::done) {
    RunDigest digest = begun->digest();
    digest.made_at_us = clock_.utc_us();
    const bool is_stored = co_await store(run, std::move(digest));
    if (is_stored) {
      pending_.erase(run);
      co_return;
    }
  }
  Pending& pending = pending_[run];
  ++pending.looks;
  if (page.problem.empty()) {
    pending.begun = std::move(begun);
  } else if (pending.looks == 1) {
    spdlog::error("run {} gets no digest: {}", run, page.problem);
  }
  pending.due_us = clock_.steady_us() + pending.delay_us;
  pending.delay_us = std::min(2 * pending.delay_us, kLongestDelay.count());
}

asio::awaitable<bool> RunDigester::store(RunId run, RunDigest digest) {
  auto job = [run, digest = std::move(digest)](Database& database) {
    try {
      write_digest(database.handle(), run, digest);
      return true;
    } catch (const SQLite::Exception&) {  // the disk is full or locked; the recorder says so
      return false;
    }
  };
  co_return co_await recorder_.on_disk(std::move(job));
}

asio::awaitable<std::optional<RunDigest>> RunDigester::stored(RunId run) {
  auto query = [run](SQLite::Database& database) { return read_digest(database, run); };
  co_return co_await reader_.ask(std::move(query));
}

}  // namespace server::storage
