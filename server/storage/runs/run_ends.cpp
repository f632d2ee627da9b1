// How runs end: what is fixed when it is asked for, who waits for it, and what is reported when nobody does any more.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "server/runtime/exceptions.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/runs/run_digester.hpp"
#include "server/storage/runs/run_store.hpp"
#include "server/storage/runs/runs.hpp"

namespace server::storage {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kEndPatience = 3s;
constexpr microseconds kEndLook = 50ms;

bool is_complete(const Run& run) { return run.samples_stored + run.samples_lost >= run.samples_expected; }

}  // namespace

Error Runs::end_is_not_stored(RunId id) {
  return {ErrorCode::unavailable,
          fmt::format("run {} ends here, with the last sample that was received; the disk cannot be written now, so "
                      "that is stored as soon as it can be",
                      id),
          "end_not_stored"};
}

Error Runs::no_such_run(RunId id) { return {ErrorCode::not_found, fmt::format("there is no run {}", id), ""}; }

asio::awaitable<void> Runs::run() {
  while (!is_loaded_) {
    co_await clock_.sleep_for(kLoadInterval);
    co_await interrupt_open();
  }
  for (;;) {
    while (!ended_late_.empty()) {
      const bool is_reported = co_await report_end(ended_late_.front());
      if (is_reported) ended_late_.erase(ended_late_.begin());
      if (!is_reported) co_await clock_.sleep_for(kLoadInterval);
    }
    co_await changed_.wait();
  }
}

// False: the disk cannot be read now.
asio::awaitable<bool> Runs::report_end(RunId id) {
  try {
    const std::optional<Run> run = co_await read(id);
    if (run) on_change_(*run);
    co_return true;
  } catch (const SQLite::Exception& error) {
    spdlog::warn("run {} cannot be read: {}; tried again", id, runtime::text_of(error));
    co_return false;
  }
}

asio::awaitable<Result<Run>> Runs::end(RunId id, std::string verdict, station::Author by, Patience patience) {
  if (verdict.size() > kMaxRunTextBytes) {
    co_return fail(ErrorCode::invalid, fmt::format("a verdict has at most {} bytes", kMaxRunTextBytes));
  }
  const auto open = std::ranges::find(open_runs_, id, [](const auto& entry) { return entry.second; });
  if (id == 0 || open == open_runs_.end()) {
    const std::optional<Run> known = co_await read(id);
    if (!known) co_return std::unexpected{no_such_run(id)};
    co_return fail(ErrorCode::conflict, fmt::format("run {} has ended already", id));
  }
  const auto robot = robots_.find(open->first);
  const station::BootId boot_id = robot == robots_.end() ? 0 : robot->second.boot_id;
  by.at_us = clock_.utc_us();
  const std::uint64_t next_seq = co_await next_seq_of(boot_id);
  const bool is_open = std::ranges::any_of(open_runs_, [id](const auto& entry) { return entry.second == id; });
  if (!is_open || ending_.contains(id)) {
    co_return fail(ErrorCode::conflict, fmt::format("run {} is being ended: that is not stored yet", id),
                   "being_ended");
  }
  ending_[id] = {};
  std::optional<Awaited> awaited{std::in_place, ending_, id};
  RunEnd run_end{boot_id, next_seq, std::move(verdict), station_document_, std::move(by)};
  recorder_.store({[id, run_end = std::move(run_end)](Database& database) { RunStore{database}.end(id, run_end); },
                   [this, id] { on_end_stored(id); }});
  bool is_flushed = co_await recorder_.flush_records();
  while (!is_flushed && ending_.contains(id) && patience == Patience::until_stored) {
    is_flushed = co_await recorder_.flush_records();
  }
  if (ending_.contains(id)) co_return std::unexpected{end_is_not_stored(id)};
  awaited.reset();
  const std::int64_t deadline_us = clock_.steady_us() + kEndPatience.count();
  for (;;) {
    const bool stored = co_await recorder_.flush(boot_id);
    std::optional<Run> run = co_await read(id);
    if (!run) co_return std::unexpected{no_such_run(id)};
    if (!stored || is_complete(*run) || clock_.steady_us() >= deadline_us) {
      digester_.add(id);
      co_return announced(std::move(*run));
    }
    co_await clock_.sleep_for(kEndLook);
  }
}

// Of a boot that is not in use all that is known is stored.
asio::awaitable<std::uint64_t> Runs::next_seq_of(station::BootId boot_id) {
  const std::uint64_t in_use = recorder_.next_seq(boot_id);
  if (in_use > 0) co_return in_use;
  auto query = [boot_id](SQLite::Database& database) { return known_next_seq(database, boot_id); };
  co_return co_await reader_.ask(std::move(query));
}

void Runs::on_end_stored(RunId id) {
  std::erase_if(open_runs_, [id](const auto& entry) { return entry.second == id; });
  const bool is_awaited = ending_.at(id).is_awaited;
  ending_.erase(id);
  if (is_awaited) return;
  digester_.add(id);
  ended_late_.push_back(id);
  changed_.notify();
}

}  // namespace server::storage
