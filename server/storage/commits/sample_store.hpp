// Writes what the recorder collected, one transaction at a time: samples with their segments, gaps, events, commands,
// the audit.
//
// Disk thread only. Uses the Database, which outlives it. The recorder has already dropped every duplicate and cut the
// samples into segments; the store numbers their rows and computes the extremes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "server/station/state/station_state.hpp"
#include "server/storage/commits/boot_store.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/samples/command_store.hpp"
#include "server/storage/samples/row_writer.hpp"
#include "server/storage/samples/segment.hpp"

namespace server::storage {

// Where the experiment of a run waited.
bool is_of_interruption(const station::RobotEvent& event);

struct StoredEvent {
  std::int64_t boot_key = 0;  // 0: an event of the station; of an interruption the database looks for its boot
  station::RobotEvent event;
};

struct StoredClock {
  std::int64_t boot_key = 0;
  station::ClockRecord record;
};

struct StoredInForce {
  std::int64_t boot_key = 0;
  station::InForceRecord record;
};

// A change of another part, in order with the samples: in one commit with the first of those that were received after
// it, or before; so none of them is stored without it. Boots that began before it are stored by then.
struct Change {
  std::function<void(Database&)>
      apply;                     // on the disk thread; again while the commit fails, so only the disk may fail it
  std::function<void()> stored;  // on the loop, once it is durable
};

// In one transaction at most.
inline constexpr std::size_t kMaxCommitSamples = 200'000;

// All that is written in one transaction.
struct WriteBatch {
  std::vector<NewBoot> new_boots;  // first, since all else may belong to them
  std::vector<Segment> segments;
  std::vector<LostRange> gaps;
  std::vector<StoredEvent> events;
  std::vector<LostRange> event_gaps;
  std::vector<station::AuditNote> audit;         // in this order, and before those of the commands
  std::vector<station::CommandRecord> commands;  // each replaces what is stored of the same command
  std::vector<StoredClock> clocks;
  std::vector<StoredInForce> in_force;
  std::map<station::RobotId, std::string> fluids;  // that robots are in from now on; empty: not known
  std::vector<BootProgress> progress;              // of each boot that any of this belongs to
  std::vector<BootStart> boots;                    // applied behind all that: they end the robots' earlier boots
  std::vector<Change> changes;                     // applied last

  bool empty() const;
};

struct LogUse {
  std::uint64_t bytes = 0;    // its length
  std::uint64_t commits = 0;  // of this handle, since it was opened
};

class SampleStore {
 public:
  explicit SampleStore(Database& database);
  ~SampleStore();
  SampleStore(const SampleStore&) = delete;
  SampleStore& operator=(const SampleStore&) = delete;

  // Durable when it returns. Throws when it cannot be (disk full): nothing of the batch is stored then.
  void write(const WriteBatch& batch);

  // The write-ahead log after the latest commit of this handle.
  LogUse log_use() const { return log_; }

 private:
  std::int64_t write_segment(const Segment& segment, std::int64_t first_row);  // returns the row after its last
  void write_event(const StoredEvent& stored);

  Database& database_;
  LogUse log_;
  BootStore boots_;
  std::int64_t next_row_ = 0;
  RowWriter rows_;
  SQLite::Statement insert_segment_;
  SQLite::Statement insert_gap_;
  SQLite::Statement insert_event_;
  SQLite::Statement insert_event_gap_;
  AuditChain audit_;
  CommandStore commands_;
  SQLite::Statement advance_row_;
  SQLite::Statement advance_boot_;
  SQLite::Statement count_commit_;
};

}  // namespace server::storage
