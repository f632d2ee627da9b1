// Drops duplicates, cuts samples into segments, and watches the holes.
#include "server/recording/boot_recording.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "server/recording/schema.hpp"

namespace server {
namespace {

// A segment stores one robot time and a period for all its samples: none may be further than this from the robot's.
constexpr std::int64_t kTimeToleranceUs = 100;
// ... and one estimate of UTC: none of its batches had one further off.
constexpr std::int64_t kUtcToleranceUs = 1000;

std::int64_t distance(std::uint64_t a, std::uint64_t b) { return std::abs(static_cast<std::int64_t>(a - b)); }

bool goes_on(const Segment& segment, const SampleBatch& batch) {
  const std::uint64_t batch_seq0_us = batch.first_robot_time_us - batch.first_seq * batch.context.period_us;
  const std::uint64_t segment_seq0_us = segment.first_robot_time_us - segment.first_seq * segment.context.period_us;
  return segment.samples.size() < static_cast<std::size_t>(kMaxSegmentSamples) && segment.context == batch.context &&
         distance(batch_seq0_us, segment_seq0_us) <= kTimeToleranceUs &&
         std::abs(segment.utc_offset_us - batch.utc_offset_us) <= kUtcToleranceUs &&
         (segment.clock_uncertainty_us < 0) == (batch.clock_uncertainty_us < 0);
}

void add_gap(std::vector<LostRange>& gaps, LostRange gap) {
  if (!gaps.empty() && gaps.back().lost.next == gap.lost.first && gaps.back().cause == gap.cause) {
    gaps.back().lost.next = gap.lost.next;
  } else {
    gaps.push_back(std::move(gap));
  }
}

}  // namespace

void BootRecording::load(StoredBoot stored) {
  key_ = stored.key;
  durable_ = received_ = std::move(stored.samples);
  durable_events_ = received_events_ = std::move(stored.events);
  next_seq_ = stored.next_seq;
  last_robot_time_us_ = stored.last_robot_time_us;
}

bool BootRecording::continues(std::uint64_t next_seq, std::uint64_t robot_time_us) const {
  return next_seq >= next_seq_ && robot_time_us >= last_robot_time_us_;
}

void BootRecording::connect(const BootStart& hello, std::uint64_t oldest_seq) {
  next_seq_ = std::max(next_seq_, hello.announced_next_seq);
  last_robot_time_us_ = std::max(last_robot_time_us_, hello.robot_time_us);
  give_up_below(oldest_seq, "ring_overrun", hello.noticed_at_us);
  hole_.reset();  // the robot now sends by itself what it holds
}

std::size_t BootRecording::count_new(const SampleBatch& batch) const {
  return count(received_.missing({batch.first_seq, batch.next_seq()}));
}

void BootRecording::append(const SampleBatch& batch, std::int64_t steady_us) {
  const auto time_us = batch.first_robot_time_us + (batch.samples.size() - 1) * batch.context.period_us;
  next_seq_ = std::max(next_seq_, batch.next_seq());
  last_robot_time_us_ = std::max(last_robot_time_us_, time_us);
  if (waiting_.empty()) waiting_since_us_ = steady_us;
  for (const Interval& part : received_.insert({batch.first_seq, batch.next_seq()})) append_part(batch, part);
}

void BootRecording::append_part(const SampleBatch& batch, Interval part) {
  for (std::uint64_t seq = part.first; seq < part.next;) {
    Segment& segment = segment_for(batch, seq);
    const std::uint64_t room = static_cast<std::uint64_t>(kMaxSegmentSamples) - segment.samples.size();
    const std::uint64_t next = std::min(part.next, seq + room);
    const auto begin = batch.samples.begin() + static_cast<std::ptrdiff_t>(seq - batch.first_seq);
    segment.samples.insert(segment.samples.end(), begin, begin + static_cast<std::ptrdiff_t>(next - seq));
    segment.received_at_us = batch.received_at_us;
    waiting_samples_ += next - seq;
    seq = next;
  }
}

// Backfill and live samples come in turns, so the segment that goes on need not be the last one.
Segment& BootRecording::segment_for(const SampleBatch& batch, std::uint64_t seq) {
  const auto begun = std::ranges::find_if(
      waiting_, [&](const Segment& segment) { return segment.next_seq() == seq && goes_on(segment, batch); });
  if (begun != waiting_.end()) return *begun;
  Segment& segment = waiting_.emplace_back();
  segment.boot_key = key_;
  segment.first_seq = seq;
  segment.first_robot_time_us = batch.first_robot_time_us + (seq - batch.first_seq) * batch.context.period_us;
  segment.context = batch.context;
  segment.first_received_at_us = batch.received_at_us;
  segment.utc_offset_us = batch.utc_offset_us;
  segment.clock_uncertainty_us = batch.clock_uncertainty_us;
  return segment;
}

void BootRecording::refuse(const SampleBatch& batch) {
  next_seq_ = std::max(next_seq_, batch.next_seq());
  for (const Interval& part : received_.missing({batch.first_seq, batch.next_seq()})) refused_.insert(part);
}

void BootRecording::give_up_below(std::uint64_t oldest_seq, const char* cause, std::int64_t utc_us) {
  for (const Interval& lost : received_.insert({0, oldest_seq})) {
    for (const Interval& part : refused_.missing(lost)) add_gap(waiting_gaps_, {key_, part, cause, utc_us});
    for (const Interval& part : refused_.covered(lost)) add_gap(waiting_gaps_, {key_, part, "queue_full", utc_us});
  }
  next_seq_ = std::max(next_seq_, oldest_seq);
}

bool BootRecording::append_event(std::uint64_t event_seq) {
  return !received_events_.insert({event_seq, event_seq + 1}).empty();
}

void BootRecording::give_up_events_below(std::uint64_t oldest_event_seq, std::int64_t utc_us) {
  for (const Interval& lost : received_events_.insert({0, oldest_event_seq})) {
    add_gap(waiting_event_gaps_, {key_, lost, "ring_overrun", utc_us});
  }
}

void BootRecording::take(WriteBatch& batch, std::int64_t steady_us, std::int64_t max_age_us) {
  const auto move_into = [](auto& from, auto& to) {
    to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
    from.clear();
  };
  move_into(waiting_gaps_, batch.gaps);
  move_into(waiting_event_gaps_, batch.event_gaps);
  const bool due =
      waiting_samples_ >= static_cast<std::size_t>(kMaxSegmentSamples) || steady_us - waiting_since_us_ >= max_age_us;
  if (waiting_.empty() || !due) return;
  move_into(waiting_, batch.segments);
  waiting_samples_ = 0;
}

std::optional<Interval> BootRecording::overdue(std::int64_t steady_us, std::int64_t patience_us,
                                               std::int64_t repeat_us) {
  const std::uint64_t first = received_.first_hole();
  if (first >= next_seq_) {
    hole_.reset();
    return std::nullopt;
  }
  const Interval hole = received_.missing({first, next_seq_}).front();
  if (!hole_ || hole.first != hole_->first) hole_since_us_ = steady_us;
  hole_ = hole;
  const bool too_early = asked_at_us_ && steady_us - *asked_at_us_ < repeat_us;
  if (steady_us - hole_since_us_ < patience_us || too_early) return std::nullopt;
  asked_at_us_ = steady_us;
  return hole;
}

bool BootRecording::all_durable() const {
  return waiting_.empty() && waiting_gaps_.empty() && waiting_event_gaps_.empty() && durable_ == received_ &&
         durable_events_ == received_events_;
}

}  // namespace server
