// Removes samples over the limits of age or size, and events over that of age: those that no run holds, the oldest
// first. Positions that were measured from outside go as soon as their run is discarded, or they are replaced.
//
// What may go is found on a reader, of events on the way. It goes in steps of one transaction on the disk thread, each
// of which ends by the clock, well before 50 ms. Commits go in between, and at least half of the disk thread's time is
// theirs. Removed pages are used again; the file shrinks only while it is larger than it may be, or while there is
// little room on the disk. Loop thread. What it is given outlives it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <optional>

#include "server/runtime/clock.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/runs/outside_references.hpp"
#include "server/storage/upkeep/disk_watch.hpp"
#include "server/storage/upkeep/retention_plan.hpp"

namespace server::storage {

struct RetentionPolicy {
  std::uint32_t retention_days = 0;        // of samples; 0: for ever
  std::uint32_t event_retention_days = 0;  // of events; 0: for ever
  std::uint64_t max_database_bytes = 0;    // 0: no limit
};

// Since the start of the program.
struct RetentionCounters {
  std::uint64_t samples_purged = 0;
  std::uint64_t events_purged = 0;
  std::uint64_t pages_returned = 0;  // to the file system
  std::int64_t longest_step_us = 0;
  bool all_held = false;  // the database is larger than it may be, and runs hold all that is left
};

class Retention {
 public:
  Retention(runtime::Clock& clock, Recorder& recorder, DatabaseReader& reader, const DiskWatch& disk_watch,
            OutsideReferences& references, RemovalClock& removal_clock, RetentionPolicy policy);

  // Before robots arrive: what is stored now, an earlier start has written.
  boost::asio::awaitable<void> open();

  // Looks every 30 s, until cancelled; also at the clock, whose state it keeps for the next start.
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
  // False: the disk fails.
  boost::asio::awaitable<bool> purge(RetentionPlan plan, std::uint64_t until_used_bytes);
  // Once a day, so that the audit gets few entries of it.
  boost::asio::awaitable<void> purge_events();
  boost::asio::awaitable<void> purge_down_to_size();
  void note_use(std::uint64_t used_bytes);  // after what could go has gone
  boost::asio::awaitable<void> shrink();
  boost::asio::awaitable<Size> size();
  boost::asio::awaitable<void> keep_clock();
  boost::asio::awaitable<std::int64_t> next_row();
  boost::asio::awaitable<std::int64_t> next_event_row();
  boost::asio::awaitable<void> make_room_for_commits(std::int64_t took_us);

  runtime::Clock& clock_;
  Recorder& recorder_;
  DatabaseReader& reader_;
  const DiskWatch& disk_watch_;
  OutsideReferences& references_;
  RemovalClock& removal_clock_;
  std::int64_t clock_stored_at_us_ = 0;  // steady
  RetentionPolicy policy_;
  SampleAges ages_;
  SampleAges event_ages_;              // of rows of events
  std::int64_t events_due_at_us_ = 0;  // steady
  RetentionCounters counters_;
};

}  // namespace server::storage
