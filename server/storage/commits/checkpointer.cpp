// When to checkpoint, and what to say when that does not help.
#include "server/storage/commits/checkpointer.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sqlite3.h>
#include <stdexcept>

#include "server/runtime/exceptions.hpp"

namespace server::storage {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr std::uint64_t kFrameBytes = 4096 + 24;  // a page and its header
constexpr std::uint64_t kPassShare = 4;           // a pass is worth while for a quarter of checkpoint_bytes
constexpr microseconds kTryInterval = 200ms;      // readers of our own are gone after 250 ms
constexpr microseconds kHeldTryInterval = 1s;
constexpr microseconds kRestartInterval = 2s;  // for the disk thread waits up to a second
constexpr microseconds kHeldRestartInterval = 10s;
constexpr int kRestartTries = 50;
constexpr int kRestartTryMs = 20;  // with the line above, one second
constexpr microseconds kHeldPatience = 5s;
constexpr microseconds kWarningInterval = 10s;

CheckpointOutcome make_pass(const std::filesystem::path& path, const std::function<bool()>& names_hold) {
  constexpr const char* kLostNames = "the files of the database have lost their names";
  try {
    if (!names_hold()) throw std::runtime_error{kLostNames};
    SQLite::Database database{path.string(), SQLite::OPEN_READWRITE};
    if (!names_hold()) throw std::runtime_error{kLostNames};   // it has read nothing yet
    database.exec("PRAGMA synchronous = FULL");                // as the log must be synced before the file is written
    database.execAndGet("SELECT value FROM meta").getInt64();  // opens the log
    return checkpoint(database, CheckpointMode::passive);
  } catch (const std::exception& error) {
    return {.log_frames = 0, .moved_frames = 0, .is_busy = false, .problem = runtime::text_of(error)};
  }
}

}  // namespace

CheckpointOutcome checkpoint(SQLite::Database& database, CheckpointMode mode) {
  int log_frames = 0;
  int moved_frames = 0;
  sqlite3* handle = database.getHandle();
  int result = SQLITE_OK;
  if (mode == CheckpointMode::passive) {
    result = sqlite3_wal_checkpoint_v2(handle, nullptr, SQLITE_CHECKPOINT_PASSIVE, &log_frames, &moved_frames);
  } else {
    // One RESTART waits for the place of an old reader even after a new reader, which is in nobody's way, has taken
    // that place. So a try is short, and the next one looks at the places anew.
    const int usual_ms = database.execAndGet("PRAGMA busy_timeout").getInt();
    database.setBusyTimeout(kRestartTryMs);
    for (int i = 0; i < kRestartTries; ++i) {
      result = sqlite3_wal_checkpoint_v2(handle, nullptr, SQLITE_CHECKPOINT_RESTART, &log_frames, &moved_frames);
      if (result != SQLITE_BUSY) break;
    }
    database.setBusyTimeout(usual_ms);
  }
  const bool is_busy = result == SQLITE_BUSY;
  CheckpointOutcome outcome{.log_frames = log_frames, .moved_frames = moved_frames, .is_busy = is_busy, .problem = {}};
  if (result != SQLITE_OK && !is_busy) outcome.problem = sqlite3_errmsg(handle);
  return outcome;
}

Checkpointer::Checkpointer(asio::io_context& loop, runtime::Clock& clock, runtime::WorkerThread& worker,
                           std::filesystem::path path, std::uint64_t checkpoint_bytes, microseconds interval)
    : clock_{clock},
      worker_{worker},
      path_{std::move(path)},
      checkpoint_bytes_{checkpoint_bytes},
      interval_{interval},
      pass_wanted_{loop},
      pass_ended_{loop},
      committed_{loop} {}

asio::awaitable<void> Checkpointer::run() {
  for (;;) {
    co_await wait_until_due();
    is_passing_ = true;
    const std::uint64_t commits = commits_;
    next_pass_us_ = clock_.steady_us() + interval_.count();
    auto pass = [path = path_, names_hold = names_hold_] { return make_pass(path, names_hold); };
    const CheckpointOutcome outcome = co_await worker_.run(std::move(pass));
    note(outcome);
    const bool moved_all = !outcome.is_busy && outcome.problem.empty() && outcome.moved_frames >= outcome.log_frames;
    if (moved_all) {
      passed_commits_ = commits;
      retry_wait_ = 0us;
    } else {
      retry_wait_ = std::min(interval_, std::max(kTryInterval, 2 * retry_wait_));
      next_pass_us_ = std::min(next_pass_us_, clock_.steady_us() + retry_wait_.count());
    }
    is_passing_ = false;
    was_passed_ = state_.bytes >= checkpoint_bytes_;
    ++state_.checkpoints;
    pass_ended_.notify();
  }
}

// is_passing_: on_log() wants one because of the length.
asio::awaitable<void> Checkpointer::wait_until_due() {
  while (!is_passing_ && !(has_new() && clock_.steady_us() >= next_pass_us_)) {
    if (has_new()) {
      co_await pass_wanted_.wait_until(clock_, next_pass_us_);
    } else {
      co_await pass_wanted_.wait();
    }
  }
}

void Checkpointer::pass_at_once() {
  next_pass_us_ = 0;
  pass_wanted_.notify();
}

void Checkpointer::on_log(const LogUse& use) {
  const std::uint64_t bytes = use.bytes;
  const bool had_new = has_new();
  if (use.commits > commits_) committed_.notify();
  commits_ = use.commits;
  if (!had_new && has_new()) pass_wanted_.notify();
  if (bytes < state_.bytes) {  // it has begun anew
    if (state_.held_since_us != 0) spdlog::info("the write-ahead log of {} has begun anew", path_.string());
    was_passed_ = false;
    moved_bytes_ = 0;
    next_restart_us_ = 0;
    is_finished_ = false;
    stuck_since_us_ = state_.held_since_us = 0;
  }
  state_.bytes = bytes;
  if (bytes < checkpoint_bytes_) return;
  watch();
  const bool is_worth_it = bytes - moved_bytes_ >= checkpoint_bytes_ / kPassShare;
  if (is_passing_ || was_passed_ || !is_worth_it || clock_.steady_us() < next_try_us_) return;
  is_passing_ = true;
  pass_wanted_.notify();
}

asio::awaitable<void> Checkpointer::wait_for_room() {
  while (is_passing_ && is_long()) co_await pass_ended_.wait();
}

bool Checkpointer::wants_finish() const {
  if (state_.bytes < checkpoint_bytes_ || is_passing_) return false;
  if (moved_bytes_ >= state_.bytes) return false;  // the next commit begins it anew
  return was_passed_ || clock_.steady_us() >= next_try_us_;
}

CheckpointMode Checkpointer::finish_mode() const {
  const bool is_time = is_finished_ && is_long() && clock_.steady_us() >= next_restart_us_;
  return is_time ? CheckpointMode::restart : CheckpointMode::passive;
}

void Checkpointer::on_finish(CheckpointMode mode, const CheckpointOutcome& outcome) {
  note(outcome);
  const microseconds interval = state_.held_since_us == 0 ? kRestartInterval : kHeldRestartInterval;
  if (mode == CheckpointMode::restart) next_restart_us_ = clock_.steady_us() + interval.count();
  was_passed_ = false;
  is_finished_ = true;
}

void Checkpointer::note(const CheckpointOutcome& outcome) {
  next_try_us_ = clock_.steady_us() + (state_.held_since_us == 0 ? kTryInterval : kHeldTryInterval).count();
  if (outcome.is_busy) return;
  moved_bytes_ = static_cast<std::uint64_t>(std::max<std::int64_t>(outcome.moved_frames, 0)) * kFrameBytes;
  problem_ = outcome.problem;
}

// All that could be moved was, and a commit went on with the same log: a reader stands in it.
void Checkpointer::watch() {
  const std::int64_t now_us = clock_.steady_us();
  if (!is_finished_ || state_.bytes <= moved_bytes_) return;
  if (stuck_since_us_ == 0) stuck_since_us_ = now_us;
  if (now_us - stuck_since_us_ < kHeldPatience.count()) return;
  if (state_.held_since_us == 0) {
    state_.held_since_us = clock_.utc_us() - (now_us - stuck_since_us_);
  } else if (now_us - warned_at_us_ < kWarningInterval.count()) {
    return;
  }
  warned_at_us_ = now_us;
  const std::string cause =
      problem_.empty() ? "another program holds a read transaction on it; end that program" : problem_;
  spdlog::warn("the write-ahead log of {} has grown to {} MB and cannot begin anew: {}", path_.string(),
               state_.bytes >> 20U, cause);
}

}  // namespace server::storage
