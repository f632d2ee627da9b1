#include "server/storage/ingest/commit_queue.hpp"

#include <algorithm>
#include <utility>

namespace server::storage {

namespace {

bool overlaps(const Segment& segment, Interval range) {
  return std::max(segment.first_seq, range.first) < std::min(segment.next_seq(), range.next);
}

}  // namespace

std::size_t CommitQueue::records() const {
  return queued_.events.size() + queued_.commands.size() + queued_.audit.size() + queued_.clocks.size() +
         queued_.in_force.size();
}

void CommitQueue::enqueue_segments(BootEntry& boot, bool all) {
  for (Segment& segment : boot.recording.take_segments(all || !boot.connected)) {
    segment_samples_ += segment.samples.size();
    segments_.push_back({std::move(segment), &boot});
    ++boot.queued_segments;
    ++enqueued_;
  }
}

void CommitQueue::enqueue(const station::CommandRecord& command) {
  queued_commands_.emplace(command.id, queued_.commands.size());
  queued_.commands.push_back(command);
}

bool CommitQueue::replace(const station::CommandRecord& command) {
  const auto queued = queued_commands_.find(command.id);
  if (queued == queued_commands_.end()) return false;
  queued_.commands[queued->second] = command;
  return true;
}

void CommitQueue::enqueue_start(BootEntry& boot, BootStart start) {
  boot.queued_starts -= std::erase_if(starts_, [&boot](const QueuedStart& queued) { return queued.boot == &boot; });
  ++boot.queued_starts;
  starts_.push_back({std::move(start), &boot, enqueued_});
}

void CommitQueue::build_commit(BootsWithRecords& with_records) {
  commit_ = std::exchange(queued_, {});
  queued_commands_.clear();
  interruptions_ = 0;
  move_gaps(with_records);
  move_segments();
  move_starts();
  move_changes();
  for (const BootEntry* boot = in_commit_.first(); boot != nullptr; boot = in_commit_.after(*boot)) {
    commit_.progress.push_back(boot->recording.progress());
  }
}

void CommitQueue::move_gaps(BootsWithRecords& with_records) {
  while (BootEntry* boot = with_records.take_first()) {
    boot->recording.move_gaps(commit_);
    in_commit_.add(*boot);
  }
}

void CommitQueue::move_segments() {
  std::size_t samples = 0;
  while (!segments_.empty() && samples + segments_.front().segment.samples.size() <= kMaxCommitSamples) {
    auto& [segment, boot] = segments_.front();
    samples += segment.samples.size();
    boot->recording.set_committed(segment);
    --boot->queued_segments;
    in_commit_.add(*boot);
    commit_.segments.push_back(std::move(segment));
    segments_.pop_front();
    ++left_;
  }
  segment_samples_ -= samples;
}

void CommitQueue::move_starts() {
  while (!starts_.empty() && starts_.front().after <= left_) {
    commit_.boots.push_back(std::move(starts_.front().start));
    starting_.push_back(starts_.front().boot);
    starts_.pop_front();
  }
}

void CommitQueue::move_changes() {
  while (!changes_.empty() && changes_.front().after <= left_) {
    commit_.changes.push_back(std::move(changes_.front().change));
    changes_.pop_front();
  }
}

WriteBatch CommitQueue::finish_commit() {
  for (BootEntry* boot : std::exchange(starting_, {})) --boot->queued_starts;
  for (const Segment& segment : commit_.segments) samples_ -= segment.samples.size();
  return std::exchange(commit_, {});
}

void CommitQueue::forget_finished() {
  while (take_finished() != nullptr) continue;
}

std::vector<const Segment*> CommitQueue::segments_of(const BootEntry& boot, Interval samples) const {
  std::vector<const Segment*> found;
  const std::int64_t boot_key = boot.recording.key();
  for (const Segment& segment : commit_.segments) {
    if (segment.boot_key == boot_key && overlaps(segment, samples)) found.push_back(&segment);
  }
  if (boot.queued_segments == 0) return found;
  for (const QueuedSegment& queued : segments_) {
    if (queued.boot == &boot && overlaps(queued.segment, samples)) found.push_back(&queued.segment);
  }
  return found;
}

}  // namespace server::storage
