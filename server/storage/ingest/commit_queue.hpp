// Decides what is written next: queues segments and records, bounds them, and builds one commit after the other.
//
//   enqueue…() → build_commit() → commit() is written → finish_commit() → take_finished() of each boot, reported
//                                      ↺ written again when that failed: the same content, nothing passes it
//
// A commit has every queued record, and segments in the order in which they were enqueued, up to kMaxCommitSamples; the
// rest goes in its turn with the next ones. A start of a boot waits until the segments that were enqueued before it are
// in a commit, a change of another part until such starts are. Samples count as queued from receipt, while they still
// wait in their boot, until they are stored.
//
// Loop thread only; owned by the Recorder. Plain bookkeeping: no clock, no database. Only commit() is read elsewhere,
// by the disk thread while it writes it. The entries of boots outlive what is queued of them: BootEntry::is_listed().
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <unordered_map>
#include <vector>

#include "server/storage/ingest/boot_entry.hpp"

namespace server::storage {

// Marks of waiting experiments that may be queued, also beyond the limit of records; those within it count, too. Some
// for each robot while the disk fails.
inline constexpr std::size_t kMostInterruptions = 1000;

// So many segments have been enqueued, or have left the queue, ever.
using QueuePosition = std::uint64_t;

class CommitQueue {
 public:
  CommitQueue(std::size_t max_samples, std::size_t max_records)
      : max_samples_{max_samples}, max_records_{max_records} {}

  // Samples that were received and are not stored yet.
  std::size_t samples() const { return samples_; }
  bool has_room_for_samples(std::size_t count) const { return samples_ + count <= max_samples_; }
  bool is_half_empty_of_samples() const { return samples_ <= max_samples_ / 2; }
  void count_received(std::size_t samples) { samples_ += samples; }

  // Segments of the boot: the complete ones, or all of them; all, too, if it is not connected.
  void enqueue_segments(BootEntry& boot, bool all);
  // As many samples as a commit takes are in the queue: others need not be touched yet.
  bool has_full_commit() const { return segment_samples_ >= kMaxCommitSamples; }

  // Records: events, commands, audit, clock estimates, texts in force. The caller asks for room; what must be stored
  // whatever waits it enqueues without.
  std::size_t records() const;
  bool has_room_for_record() const { return records() < max_records_; }
  bool is_half_empty_of_records() const { return records() <= max_records_ / 2; }
  void enqueue(StoredEvent event) { queued_.events.push_back(std::move(event)); }
  bool has_room_for_interruption() const { return has_room_for_record() || interruptions_ < kMostInterruptions; }
  void enqueue_interruption(StoredEvent event) {
    ++interruptions_;
    enqueue(std::move(event));
  }
  void enqueue(station::AuditNote note) { queued_.audit.push_back(std::move(note)); }
  void enqueue(StoredClock clock) { queued_.clocks.push_back(clock); }
  void enqueue(StoredInForce in_force) { queued_.in_force.push_back(std::move(in_force)); }
  void enqueue(const station::CommandRecord& command);
  // An earlier state of the command is queued: it becomes this one, which needs no room. False: none is.
  bool replace(const station::CommandRecord& command);
  // At most one for each robot.
  void set_fluid(const station::RobotId& robot_id, const std::string& fluid) { queued_.fluids[robot_id] = fluid; }

  bool has_room_for_boot() const { return queued_.new_boots.size() < max_records_; }
  void enqueue(NewBoot boot) { queued_.new_boots.push_back(std::move(boot)); }
  // Takes the place of one that is queued of the same boot.
  void enqueue_start(BootEntry& boot, BootStart start);

  // It goes with the first commit that has all starts of boots that were queued before it.
  void enqueue(Change change) { changes_.push_back({std::move(change), end_of_starts()}); }

  // Nothing is queued but segments.
  bool has_no_records() const { return queued_.empty() && changes_.empty(); }

  // Makes the next commit of what is queued and of the gaps and events of these boots. There must be no commit.
  void build_commit(BootsWithRecords& with_records);
  bool has_commit() const { return !commit_.empty(); }
  const WriteBatch& commit() const { return commit_; }
  std::size_t events() const { return commit_.events.size() + queued_.events.size(); }  // queued, or in the commit
  std::size_t commands() const {
    return commit_.commands.size() + queued_.commands.size();
  }  // queued, or in the commit
  // The commit is durable; returns what was in it.
  WriteBatch finish_commit();
  // A boot of the finished commit, in the order of its progress; null: none is left.
  BootEntry* take_finished() { return in_commit_.take_first(); }
  // Nobody reports what is durable any more.
  void forget_finished();

  // To wait for all that is enqueued now, wait until as many segments have left the queue.
  QueuePosition end() const { return enqueued_; }
  // The same for starts of boots.
  QueuePosition end_of_starts() const { return starts_.empty() ? 0 : starts_.back().after; }
  bool has_starts() const { return !starts_.empty() || !commit_.boots.empty(); }
  // So many have left it for a commit, the one of commit() included.
  QueuePosition position() const { return left_; }

  // Segments of the boot with samples in the range, queued or in the commit; as long as nothing changes.
  std::vector<const Segment*> segments_of(const BootEntry& boot, Interval samples) const;

 private:
  struct QueuedSegment {
    Segment segment;
    BootEntry* boot = nullptr;
  };
  struct QueuedStart {
    BootStart start;
    BootEntry* boot = nullptr;
    QueuePosition after = 0;
  };

  struct QueuedChange {
    Change change;
    QueuePosition after = 0;
  };

  void move_gaps(BootsWithRecords& with_records);
  void move_segments();
  void move_starts();
  void move_changes();

  std::size_t max_samples_;
  std::size_t max_records_;
  std::size_t samples_ = 0;

  WriteBatch queued_;                                                    // records; the rest waits in the next two
  std::unordered_map<station::CommandId, std::size_t> queued_commands_;  // where each waits in queued_.commands
  std::size_t interruptions_ = 0;                                        // in queued_.events
  std::deque<QueuedSegment> segments_;
  std::size_t segment_samples_ = 0;  // of segments_
  std::deque<QueuedStart> starts_;
  std::deque<QueuedChange> changes_;
  QueuePosition enqueued_ = 0;
  QueuePosition left_ = 0;

  WriteBatch commit_;                 // kept until it is durable
  BootsInCommit in_commit_;           // in the order of its progress
  std::vector<BootEntry*> starting_;  // in the order of its starts of boots
};

}  // namespace server::storage
