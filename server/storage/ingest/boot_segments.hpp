// Segments between the boots and the disk: which go into the commit queue now, and which still wait for a reader.
//
// Loop thread. Pure functions between the BootRegistry, which knows what is due, and the CommitQueue.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/storage/ingest/boot_registry.hpp"
#include "server/storage/ingest/commit_queue.hpp"

namespace server::storage {

// Enqueues what is due: only as much as a commit takes, the rest is not touched until its turn. `now_us` is steady.
void enqueue_due(BootRegistry& boots, CommitQueue& queue, std::int64_t now_us);

void enqueue_everything(BootRegistry& boots, CommitQueue& queue);

// What was received of a boot and is not durable yet, wherever it waits, in the form in which the database will give it
// back. Samples of the range, ascending, cut to it: of the first segments that have `limit` samples together. When the
// last sample of a segment has arrived is not said while others may follow it, so that a time which was read once stays
// the same; clock_uncertainty_us may grow until then.
std::vector<Segment> waiting_samples(const CommitQueue& queue, const BootEntry& boot, Interval range,
                                     std::size_t limit);

// Gaps that the range touches, ascending.
std::vector<LostRange> waiting_gaps(const CommitQueue& queue, const BootEntry& boot, Interval range);

}  // namespace server::storage
