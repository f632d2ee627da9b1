// Drops duplicates, cuts samples into segments, and watches the holes.
#include "server/storage/ingest/boot_recording.hpp"

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <utility>

#include "server/runtime/clock.hpp"
#include "server/storage/database/schema.hpp"

namespace server::storage {
using namespace std::chrono_literals;

namespace {

// A segment stores one robot time and a period for all its samples: none may be further than this from the robot's.
constexpr std::int64_t kTimeToleranceUs = 100;
// ... and one estimate of UTC: none of its batches had one further off. Where there is no estimate it is the time of
// receipt, whose jitter ends no segment.
constexpr std::int64_t kUtcToleranceUs = 1000;
constexpr std::int64_t kUnknownUtcToleranceUs = 1'000'000;

constexpr microseconds kHolePatience = 500ms;  // before a hole that does not shrink is asked for
constexpr microseconds kAskInterval = 1s;

// The robot's time of a sample of this batch, less the time that the segment stores of it.
std::int64_t later_us(const station::SampleBatch& batch, const Segment& segment) {
  const std::uint64_t batch_seq0_us = batch.first_robot_time_us - batch.first_seq * batch.context.period_us;
  const std::uint64_t segment_seq0_us = segment.first_robot_time_us - segment.first_seq * segment.context.period_us;
  return static_cast<std::int64_t>(batch_seq0_us - segment_seq0_us);
}

bool goes_on(const Segment& segment, const station::SampleBatch& batch) {
  const std::int64_t utc_tolerance_us = batch.clock_uncertainty_us < 0 ? kUnknownUtcToleranceUs : kUtcToleranceUs;
  return segment.context == batch.context && std::abs(later_us(batch, segment)) <= kTimeToleranceUs &&
         std::abs(segment.utc_offset_us - batch.utc_offset_us) <= utc_tolerance_us &&
         (segment.clock_uncertainty_us < 0) == (batch.clock_uncertainty_us < 0);
}

// How wrong the segment's estimate of UTC may be for the samples of this batch; -1: there was none.
std::int64_t uncertainty_in(const Segment& segment, const station::SampleBatch& batch) {
  if (batch.clock_uncertainty_us < 0) return -1;
  return batch.clock_uncertainty_us + std::abs(batch.utc_offset_us - segment.utc_offset_us + later_us(batch, segment));
}

void add_gap(std::vector<LostRange>& gaps, LostRange gap) {
  if (!gaps.empty() && gaps.back().lost.next == gap.lost.first && gaps.back().cause == gap.cause) {
    gaps.back().lost.next = gap.lost.next;
  } else {
    gaps.push_back(std::move(gap));
  }
}

// What the station had refused is lost because of that, whatever the robot's reason is.
void add_lost(std::vector<LostRange>& gaps, const LostRange& range, const IntervalSet& refused) {
  LostRange part = range;
  for (const Interval& missing : refused.missing(range.lost)) {
    part.lost = missing;
    add_gap(gaps, part);
  }
  part.cause = "queue_full";
  for (const Interval& covered : refused.covered(range.lost)) {
    part.lost = covered;
    add_gap(gaps, part);
  }
}

}  // namespace

void BootRecording::load(StoredBoot stored) {
  key_ = stored.key;
  committed_ = received_ = std::move(stored.samples);
  given_up_ = std::move(stored.given_up);
  received_events_ = std::move(stored.events);
  durable_next_seq_ = received_.first_hole();
  durable_next_event_seq_ = received_events_.first_hole();
  next_seq_ = stored.next_seq;
  next_event_seq_ = stored.next_event_seq;
  last_robot_time_us_ = stored.last_robot_time_us;
  connected_at_us_ = stored.connected_at_us;
}

bool BootRecording::continues(std::uint64_t next_seq, std::uint64_t robot_time_us) const {
  return next_seq >= next_seq_ && robot_time_us >= last_robot_time_us_;
}

void BootRecording::connect(const station::AdmissionRequest& hello, std::int64_t restored_at_us) {
  const std::int64_t booted_at_us = hello.received_at_us - static_cast<std::int64_t>(hello.robot_time_us);
  const bool is_from_before = std::max(connected_at_us_, booted_at_us) < restored_at_us;
  const char* cause = is_from_before ? "restore" : "ring_overrun";
  const char* acknowledged_cause = is_from_before ? "restore" : "acknowledged_earlier";
  connected_at_us_ = hello.received_at_us;
  next_seq_ = std::max(next_seq_, hello.next_seq);
  last_robot_time_us_ = std::max(last_robot_time_us_, hello.robot_time_us);
  set_lost_below(std::min(hello.acknowledged_next_seq, hello.oldest_seq), acknowledged_cause, hello.received_at_us);
  set_lost_below(hello.oldest_seq, cause, hello.received_at_us);
  next_event_seq_ = std::max(next_event_seq_, hello.next_event_seq);
  set_events_lost_below(std::min(hello.acknowledged_next_event_seq, hello.oldest_event_seq), acknowledged_cause,
                        hello.received_at_us);
  set_events_lost_below(hello.oldest_event_seq, cause, hello.received_at_us);
  returned_.clear();
  for (const Interval& held : given_up_.covered({hello.oldest_seq, hello.next_seq})) {
    std::ranges::copy(ever_returned_.insert(held), std::back_inserter(returned_));
  }
  sample_hole_.reset();  // the robot now sends by itself what it holds
  event_hole_.reset();
}

std::size_t BootRecording::count_new(const station::SampleBatch& batch) const {
  if (batch.first_seq >= received_.end()) return batch.samples.size();  // live, as nearly all are
  return count(received_.missing({batch.first_seq, batch.next_seq()}));
}

void BootRecording::append(const station::SampleBatch& batch, std::uint64_t robot_now_us, std::int64_t steady_us) {
  const auto time_us = batch.first_robot_time_us + (batch.samples.size() - 1) * batch.context.period_us;
  next_seq_ = std::max(next_seq_, batch.next_seq());
  // A sample may say a time that its robot's clock has not reached; the robot may all the same connect again.
  last_robot_time_us_ = std::max(last_robot_time_us_, std::min(time_us, robot_now_us));
  if (waiting_.empty()) waiting_since_us_ = steady_us;
  const Interval samples{batch.first_seq, batch.next_seq()};
  if (received_.extend(samples)) return append_part(batch, samples, steady_us);
  for (const Interval& part : received_.insert(samples)) {
    append_part(batch, part, steady_us);
  }
}

// How many samples from this one on the segment may have. Any 100 boots end their segments at samples spread evenly.
std::uint64_t BootRecording::room_from(std::uint64_t seq) const {
  constexpr std::uint64_t kMost = kMaxSegmentSamples;
  return kMost - (seq + kBootsApart * static_cast<std::uint64_t>(key_ - 1)) % kMost;
}

void BootRecording::append_part(const station::SampleBatch& batch, Interval part, std::int64_t steady_us) {
  for (std::uint64_t seq = part.first; seq < part.next;) {
    const std::size_t index = segment_for(batch, seq);
    Segment& segment = waiting_[index];
    const std::uint64_t end = seq + room_from(seq);
    const std::uint64_t next = std::min(part.next, end);
    const auto begin = batch.samples.begin() + static_cast<std::ptrdiff_t>(seq - batch.first_seq);
    // Room for all only once it has gone on: one that a change of context ends soon waits in no more than it needs.
    if (!segment.samples.empty()) segment.samples.reserve(end - segment.first_seq);
    segment.samples.insert(segment.samples.end(), begin, begin + static_cast<std::ptrdiff_t>(next - seq));
    segment.received_at_us = batch.received_at_us;
    segment.clock_uncertainty_us = std::max(segment.clock_uncertainty_us, uncertainty_in(segment, batch));
    if (next == end) {
      complete_ = std::max(complete_, index + 1);
      completed_at_us_ = steady_us;
    }
    seq = next;
  }
}

// Backfill and live samples come in turns, so the segment that goes on need not be the last one.
std::size_t BootRecording::segment_for(const station::SampleBatch& batch, std::uint64_t seq) {
  const bool begins = room_from(seq) == static_cast<std::uint64_t>(kMaxSegmentSamples);
  for (std::size_t index = begins ? 0 : waiting_.size(); index > 0; --index) {
    const Segment& segment = waiting_[index - 1];
    if (segment.next_seq() == seq && goes_on(segment, batch)) return index - 1;
  }
  Segment& segment = waiting_.emplace_back();
  segment.boot_key = key_;
  segment.first_seq = seq;
  segment.first_robot_time_us = batch.first_robot_time_us + (seq - batch.first_seq) * batch.context.period_us;
  segment.context = batch.context;
  segment.first_received_at_us = batch.received_at_us;
  segment.utc_offset_us = batch.utc_offset_us;
  segment.clock_uncertainty_us = batch.clock_uncertainty_us;
  return waiting_.size() - 1;
}

bool BootRecording::may_grow(const Segment& waiting) const {
  const std::uint64_t next = waiting.next_seq();
  const bool is_complete = room_from(next) == static_cast<std::uint64_t>(kMaxSegmentSamples);
  return !is_complete && !received_.contains(next);
}

void BootRecording::refuse(const station::SampleBatch& batch) {
  next_seq_ = std::max(next_seq_, batch.next_seq());
  refused_.erase_below(received_.first_hole());
  for (const Interval& part : received_.missing({batch.first_seq, batch.next_seq()})) refused_.insert(part);
}

void BootRecording::set_lost_below(std::uint64_t oldest_seq, const char* cause, std::int64_t utc_us) {
  if (oldest_seq <= received_.first_hole()) return;
  for (const Interval& lost : received_.insert({0, oldest_seq})) {
    add_lost(waiting_gaps_, {key_, lost, cause, utc_us}, refused_);
  }
  next_seq_ = std::max(next_seq_, oldest_seq);
}

void BootRecording::set_lost(Interval samples, const char* cause, std::int64_t utc_us) {
  for (const Interval& lost : received_.insert(samples)) add_gap(waiting_gaps_, {key_, lost, cause, utc_us});
  next_seq_ = std::max(next_seq_, samples.next);
}

void BootRecording::give_up(Interval samples, std::int64_t utc_us) {
  for (const Interval& lost : received_.insert(made(samples))) {
    add_gap(waiting_gaps_, {key_, lost, kGivenUp, utc_us});
    given_up_.insert(lost);
  }
}

std::uint64_t BootRecording::count_given_up(const station::SampleBatch& batch) const {
  return count(given_up_.covered({batch.first_seq, batch.next_seq()}));
}

void BootRecording::set_event_lost(std::uint64_t event_seq, const char* cause, std::int64_t utc_us) {
  for (const Interval& lost : received_events_.insert({event_seq, event_seq + 1})) {
    add_gap(waiting_event_gaps_, {key_, lost, cause, utc_us});
  }
  next_event_seq_ = std::max(next_event_seq_, event_seq + 1);
}

bool BootRecording::append_event(std::uint64_t event_seq) {
  const bool is_new = !received_events_.insert({event_seq, event_seq + 1}).empty();
  has_new_events_ = has_new_events_ || is_new;
  next_event_seq_ = std::max(next_event_seq_, event_seq + 1);
  return is_new;
}

void BootRecording::refuse_event(std::uint64_t event_seq) {
  next_event_seq_ = std::max(next_event_seq_, event_seq + 1);
  refused_events_.erase_below(received_events_.first_hole());
  refused_events_.insert({event_seq, event_seq + 1});
}

void BootRecording::set_events_lost_below(std::uint64_t oldest_event_seq, const char* cause, std::int64_t utc_us) {
  if (oldest_event_seq <= received_events_.first_hole()) return;
  for (const Interval& lost : received_events_.insert({0, oldest_event_seq})) {
    add_lost(waiting_event_gaps_, {key_, lost, cause, utc_us}, refused_events_);
  }
}

std::vector<Segment> BootRecording::take_segments(bool all) {
  const auto end = waiting_.begin() + static_cast<std::ptrdiff_t>(all ? waiting_.size() : complete_);
  std::vector<Segment> taken{std::make_move_iterator(waiting_.begin()), std::make_move_iterator(end)};
  waiting_.erase(waiting_.begin(), end);
  complete_ = 0;
  waiting_since_us_ = completed_at_us_;  // what is left began then, or later
  return taken;
}

void BootRecording::move_gaps(WriteBatch& batch) {
  for (const LostRange& gap : waiting_gaps_) committed_.insert(gap.lost);
  std::ranges::move(std::exchange(waiting_gaps_, {}), std::back_inserter(batch.gaps));
  std::ranges::move(std::exchange(waiting_event_gaps_, {}), std::back_inserter(batch.event_gaps));
  has_new_events_ = false;
}

void BootRecording::set_committed(const Segment& segment) {
  if (!committed_.extend(segment.interval())) committed_.insert(segment.interval());
  const std::uint64_t time_us = std::min(segment.robot_time_us(segment.samples.size() - 1), last_robot_time_us_);
  committed_robot_time_us_ = std::max(committed_robot_time_us_, time_us);
}

BootProgress BootRecording::progress() const {
  return {.boot_key = key_,
          .durable_next_seq = committed_.first_hole(),
          .durable_next_event_seq = received_events_.first_hole(),
          .last_robot_time_us = committed_robot_time_us_};
}

void BootRecording::set_durable(const BootProgress& progress) {
  durable_next_seq_ = progress.durable_next_seq;
  durable_next_event_seq_ = progress.durable_next_event_seq;
}

bool HoleWatch::is_overdue(std::uint64_t first_missing, std::int64_t steady_us) {
  if (first_ != first_missing) since_us_ = steady_us;
  first_ = first_missing;
  const bool too_early = asked_at_us_ && steady_us - *asked_at_us_ < kAskInterval.count();
  if (steady_us - since_us_ < kHolePatience.count() || too_early) return false;
  asked_at_us_ = steady_us;
  return true;
}

std::optional<Interval> BootRecording::overdue_samples(std::int64_t steady_us) {
  const std::uint64_t first = received_.first_hole();
  if (!misses_samples() || !sample_hole_.is_overdue(first, steady_us)) return std::nullopt;
  // Every hole up to what was given up, which is not asked for; what comes twice is dropped.
  const std::vector<Interval> given_up = given_up_.covered({first, next_seq_});
  const std::uint64_t end = given_up.empty() ? next_seq_ : given_up.front().first;
  return Interval{first, received_.missing({first, end}).back().next};
}

bool BootRecording::has_overdue_events(std::int64_t steady_us) {
  return misses_events() && event_hole_.is_overdue(received_events_.first_hole(), steady_us);
}

}  // namespace server::storage
