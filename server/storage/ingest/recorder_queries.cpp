// What the recorder knows and the disk does not yet, and the ways to wait until it does.
#include <algorithm>
#include <limits>

#include "server/storage/ingest/recorder.hpp"

namespace server {
namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr microseconds kFlushPatience = 3s;

// Those of the boot that have samples in the range.
void add_waiting(const auto& segments, std::int64_t boot_key, Interval range, std::vector<const Segment*>& into) {
  for (const Segment& segment : segments) {
    const bool overlaps = std::max(segment.first_seq, range.first) < std::min(segment.next_seq(), range.next);
    if (segment.boot_key == boot_key && overlaps) into.push_back(&segment);
  }
}

}  // namespace

std::uint64_t Recorder::next_seq(BootId boot_id) const {
  const auto found = boots_.find(boot_id);
  return found == boots_.end() ? 0 : found->second.recording.next_seq();
}

std::vector<Segment> Recorder::waiting(BootId boot_id, Interval samples, std::size_t limit) const {
  std::vector<Segment> segments;
  std::vector<const Segment*> heard;
  const auto found = boots_.find(boot_id);
  if (found == boots_.end() || !found->second.recording.loaded()) return segments;
  const BootRecording& boot = found->second.recording;
  add_waiting(writing_.segments, boot.key(), samples, heard);  // the disk thread only reads it, too
  if (found->second.in_line > 0) add_waiting(line_, boot.key(), samples, heard);
  add_waiting(boot.waiting(), boot.key(), samples, heard);
  std::ranges::sort(heard, {}, [](const Segment* segment) { return segment->first_seq; });
  std::size_t copied = 0;
  for (auto segment = heard.begin(); segment != heard.end() && copied < limit; ++segment) {
    Segment& part = segments.emplace_back(part_of(**segment, samples));
    std::ranges::transform(part.samples, part.samples.begin(), as_stored);
    copied += part.samples.size();
  }
  return segments;
}

std::vector<LostRange> Recorder::waiting_gaps(BootId boot_id, Interval samples) const {
  std::vector<LostRange> gaps;
  const auto found = boots_.find(boot_id);
  if (found == boots_.end() || !found->second.recording.loaded()) return gaps;
  const BootRecording& boot = found->second.recording;
  const auto is_wanted = [&boot, samples](const LostRange& gap) {
    const bool overlaps = std::max(gap.lost.first, samples.first) < std::min(gap.lost.next, samples.next);
    return gap.boot_key == boot.key() && overlaps;
  };
  std::ranges::copy_if(writing_.gaps, std::back_inserter(gaps), is_wanted);
  std::ranges::copy_if(boot.waiting_gaps(), std::back_inserter(gaps), is_wanted);
  std::ranges::sort(gaps, {}, [](const LostRange& gap) { return gap.lost.first; });
  return gaps;
}

asio::awaitable<bool> Recorder::flush() {
  line_up_everything();
  co_return co_await flush_after(lined_up_);
}

asio::awaitable<bool> Recorder::flush(BootId boot_id) {
  const auto found = boots_.find(boot_id);
  if (found == boots_.end() || !found->second.recording.loaded()) co_return true;
  const Boot& boot = found->second;
  const bool waits = boot.is_written || boot.in_line > 0 || boot.has_records || !boot.recording.waiting().empty();
  if (!waits) co_return true;
  line_up(*found, true);
  co_return co_await flush_after(lined_up_);
}

asio::awaitable<bool> Recorder::flush_records() {
  co_return co_await flush_after(starts_.empty() ? 0 : starts_.back().after);
}

asio::awaitable<bool> Recorder::flush_boots() {
  if (starts_.empty() && writing_.boots.empty()) co_return true;
  co_return co_await flush_records();
}

asio::awaitable<bool> Recorder::flush_after(std::uint64_t segments) {
  // Who gave up is dropped here, too: while the disk fails nothing else does it.
  std::erase_if(flushes_, [](const Flush& flush) { return flush.done.expired(); });
  const auto done = std::make_shared<Signal>(loop_);
  flushes_.push_back({done, segments});
  flush_wanted_.notify();
  wake();
  co_return co_await done->wait_until(clock_, clock_.steady_us() + kFlushPatience.count());
}

}  // namespace server
