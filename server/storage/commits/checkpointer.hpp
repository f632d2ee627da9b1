// Moves the write-ahead log into the database beside the commits, and watches that the log does not grow.
//
//   log ≥ checkpoint_bytes → a pass on a thread and handle of its own → the disk thread finishes between two commits
//   → the next commit begins the log anew, unless a reader stands in it
//
// A shorter log is moved by a pass at the first commit, with the first samples, and whenever the latest pass is
// `interval` ago and something was committed since: so who loses the log loses seconds, and never the schema
// (database.cpp). What such a pass leaves (somebody reads in the log, or it failed) is tried again after 200 ms, then
// after twice as long each time, up to `interval`.
//
// When the log has grown by half again, a commit waits for a pass that is under way, and the disk thread waits for
// readers that stand in the log (ours are gone after 250 ms). So it grows no further than by one more commit, and stays
// below twice checkpoint_bytes; only a foreign program that holds a read transaction makes it longer, which is logged
// and counted.
//
// Loop thread; the work is done on the two workers. Loop, clock and worker outlive it.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>

#include "server/runtime/clock.hpp"
#include "server/runtime/worker.hpp"
#include "server/storage/commits/sample_store.hpp"

namespace server::storage {

// The write-ahead log.
struct WalState {
  std::uint64_t bytes = 0;         // in use; the file may be longer
  std::int64_t held_since_us = 0;  // UTC since when it should have begun anew and could not; 0: it could
  std::uint64_t checkpoints = 0;   // passes, since the start of the program
};

// What a checkpoint came to.
struct CheckpointOutcome {
  std::int64_t log_frames = 0;
  std::int64_t moved_frames = 0;  // of them, into the database
  bool is_busy = false;           // another checkpoint is under way, or a reader did not go
  std::string problem;            // empty: none
};

enum class CheckpointMode : std::uint8_t {
  passive,  // moves what no reader needs, and waits for nobody
  restart,  // waits for readers, as long as the handle waits for locks: the next commit begins the log anew
};

// Of the handle's thread.
CheckpointOutcome checkpoint(SQLite::Database& database, CheckpointMode mode);

class Checkpointer {
 public:
  Checkpointer(boost::asio::io_context& loop, runtime::Clock& clock, runtime::WorkerThread& worker,
               std::filesystem::path path, std::uint64_t checkpoint_bytes, microseconds interval);

  // SAFETY: whether the names of the database lead to the files that the station has open; asked on the worker before
  // and after a pass opens it by its name. With another file there a pass would damage both.
  void set_names_hold(std::function<bool()> names_hold) { names_hold_ = std::move(names_hold); }
  const std::function<bool()>& names_hold() const { return names_hold_; }

  // Makes the passes, until cancelled.
  boost::asio::awaitable<void> run();

  // After work of the disk thread: so long is the log.
  void on_log(const LogUse& use);
  // Returns when something was committed since it returned last; at once if something was before the first time. For
  // one coroutine.
  boost::asio::awaitable<void> next_commit() { return committed_.wait(); }
  // What was committed is worth a pass, however short the log is and whenever the latest one was.
  void pass_at_once();
  // Before a commit.
  boost::asio::awaitable<void> wait_for_room();
  // Little is left to move, or a pass has left it: the disk thread is to do it now, and to say what came of it.
  bool wants_finish() const;
  CheckpointMode finish_mode() const;
  void on_finish(CheckpointMode mode, const CheckpointOutcome& outcome);

  const WalState& state() const { return state_; }

 private:
  boost::asio::awaitable<void> wait_until_due();
  bool has_new() const { return commits_ > passed_commits_; }
  void note(const CheckpointOutcome& outcome);
  bool is_long() const { return state_.bytes >= checkpoint_bytes_ + checkpoint_bytes_ / 2; }
  void watch();

  runtime::Clock& clock_;
  runtime::WorkerThread& worker_;
  std::filesystem::path path_;
  std::uint64_t checkpoint_bytes_;
  microseconds interval_;
  runtime::Signal pass_wanted_;
  runtime::Signal pass_ended_;
  runtime::Signal committed_;

  std::function<bool()> names_hold_ = [] { return true; };
  WalState state_;
  std::uint64_t commits_ = 0;         // that have gone into the log
  std::uint64_t passed_commits_ = 0;  // are in the database, too, and maybe more
  std::int64_t next_pass_us_ = 0;     // steady; of a log that is short
  microseconds retry_wait_{0};        // after passes that left something; 0: the latest one left nothing
  bool is_passing_ = false;
  bool was_passed_ = false;           // since the log began, and something of it may be left
  std::uint64_t moved_bytes_ = 0;     // of this log, into the database
  std::int64_t next_try_us_ = 0;      // steady
  std::int64_t next_restart_us_ = 0;  // steady
  bool is_finished_ = false;          // all that could be moved was, so it should begin anew
  std::int64_t stuck_since_us_ = 0;   // steady; a commit did not begin it anew; 0: none was made, or it did
  std::int64_t warned_at_us_ = 0;     // steady
  std::string problem_;               // of the latest try
};

}  // namespace server::storage
