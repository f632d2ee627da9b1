#include "server/storage/ingest/boot_segments.hpp"

#include <algorithm>
#include <iterator>

namespace server::storage {

// First the complete segments, so that what has just begun after one is not taken for old.
void enqueue_due(BootRegistry& boots, CommitQueue& queue, std::int64_t now_us) {
  while (!queue.has_full_commit()) {
    BootEntry* boot = boots.take_due();
    if (boot == nullptr) break;
    queue.enqueue_segments(*boot, false);
  }
  while (!queue.has_full_commit()) {
    BootEntry* boot = boots.take_aged(now_us);
    if (boot == nullptr) break;
    queue.enqueue_segments(*boot, true);
    boots.watch(*boot);
  }
}

void enqueue_everything(BootRegistry& boots, CommitQueue& queue) {
  for (auto& [boot_id, boot] : boots.all()) queue.enqueue_segments(boot, true);
}

std::vector<Segment> waiting_samples(const CommitQueue& queue, const BootEntry& boot, Interval range,
                                     std::size_t limit) {
  struct Found {
    const Segment* segment;
    bool may_grow;
  };
  std::vector<Found> found;
  for (const Segment* segment : queue.segments_of(boot, range)) found.push_back({segment, false});
  for (const Segment& segment : boot.recording.waiting()) {
    if (std::max(segment.first_seq, range.first) < std::min(segment.next_seq(), range.next))
      found.push_back({&segment, boot.recording.may_grow(segment)});
  }
  std::ranges::sort(found, {}, [](const Found& one) { return one.segment->first_seq; });
  std::vector<Segment> segments;
  std::size_t copied = 0;
  for (auto one = found.begin(); one != found.end() && copied < limit; ++one) {
    Segment& part = segments.emplace_back(part_of(*one->segment, range));
    std::ranges::transform(part.samples, part.samples.begin(), as_stored);
    if (one->may_grow) part.received_at_us = 0;
    copied += part.samples.size();
  }
  return segments;
}

std::vector<LostRange> waiting_gaps(const CommitQueue& queue, const BootEntry& boot, Interval range) {
  const auto is_wanted = [&boot, range](const LostRange& gap) {
    const bool overlaps = std::max(gap.lost.first, range.first) < std::min(gap.lost.next, range.next);
    return gap.boot_key == boot.recording.key() && overlaps;
  };
  std::vector<LostRange> gaps;
  std::ranges::copy_if(queue.commit().gaps, std::back_inserter(gaps), is_wanted);
  std::ranges::copy_if(boot.recording.waiting_gaps(), std::back_inserter(gaps), is_wanted);
  std::ranges::sort(gaps, {}, [](const LostRange& gap) { return gap.lost.first; });
  return gaps;
}

}  // namespace server::storage
