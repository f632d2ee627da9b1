// Removes what is too old or too much: samples that no run holds, the oldest first.
//
// Steps of one transaction on the disk thread, each of at most 50 ms: their size follows from what the last one took.
// Commits go in between, and at least half of the disk thread's time is theirs. Removed pages are used again; the file
// shrinks only while it is larger than it may be, or while there is little room on the disk.
// Loop thread. What it is given outlives it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <optional>

#include "server/clock.hpp"
#include "server/recording/disk_watch.hpp"
#include "server/recording/recorder.hpp"
#include "server/recording/retention_plan.hpp"
#include "server/worker.hpp"

namespace server {

struct RetentionPolicy {
  std::uint32_t retention_days = 0;      // 0: for ever
  std::uint64_t max_database_bytes = 0;  // 0: no limit
};

// Since the start of the program.
struct RetentionCounters {
  std::uint64_t samples_purged = 0;
  std::uint64_t pages_returned = 0;  // to the file system
  std::int64_t longest_step_us = 0;
  bool all_held = false;  // the database is larger than it may be, and runs hold all that is left
};

// How large a step may be, for it to take 50 ms at most.
class StepSize {
 public:
  StepSize(std::size_t begin, std::size_t end) : value_{begin}, end_{end} {}
  std::size_t value() const { return value_; }
  void note(std::int64_t took_us);

 private:
  std::size_t value_;
  std::size_t end_;
};

class Retention {
 public:
  Retention(Clock& clock, Recorder& recorder, WorkerThread& readers, const DiskWatch& disk_watch,
            RetentionPolicy policy);

  // Looks every 30 s, until cancelled.
  boost::asio::awaitable<void> run();
  // Removes all that is to go now.
  boost::asio::awaitable<void> pass();

  const RetentionPolicy& policy() const { return policy_; }
  const RetentionCounters& counters() const { return counters_; }

 private:
  struct Size {
    std::uint64_t file_bytes = 0;
    std::uint64_t used_bytes = 0;  // without the free pages in it
  };
  boost::asio::awaitable<void> purge_older_than(std::int64_t utc_us, std::uint64_t until_used_bytes);
  boost::asio::awaitable<void> purge_down_to_size();
  void note_use(std::uint64_t used_bytes);  // after what could go has gone
  boost::asio::awaitable<void> shrink();
  boost::asio::awaitable<Size> size();
  boost::asio::awaitable<std::optional<std::int64_t>> oldest_us();
  boost::asio::awaitable<void> make_room_for_commits(std::int64_t took_us);

  Clock& clock_;
  Recorder& recorder_;
  WorkerThread& readers_;
  const DiskWatch& disk_watch_;
  RetentionPolicy policy_;
  RetentionCounters counters_;
  StepSize segments_{50, 500};
  StepSize pages_{64, 1024};
};

}  // namespace server
