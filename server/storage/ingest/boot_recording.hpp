// One boot of a robot as the recorder sees it: what is here, what waits to be written, what is still missing.
//
// Loop thread only; owned by its BootEntry. Plain bookkeeping: it neither waits nor writes. Times are the caller's.
//
//   received = committed + waiting or queued (samples and known gaps)
//   committed = what went into a commit, done or under way
//   next_seq ≥ received.end(): every sample below it was made by the robot
//
// Segments end at the same samples of a boot whatever happens before: where seq + 37 · key is a multiple of 100. So
// robots that connect together have complete segments at different times, a tenth of them each 100 ms at 100 Hz.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "server/storage/commits/sample_store.hpp"

namespace server::storage {

// When to ask for what is missing: once its beginning was the same for a while, and then at intervals.
class HoleWatch {
 public:
  void reset() { first_.reset(); }
  bool is_overdue(std::uint64_t first_missing, std::int64_t steady_us);

 private:
  std::optional<std::uint64_t> first_;
  std::int64_t since_us_ = 0;
  std::optional<std::int64_t> asked_at_us_;
};

class BootRecording {
 public:
  explicit BootRecording(station::RobotId robot_id) : robot_id_{std::move(robot_id)} {}

  const station::RobotId& robot_id() const { return robot_id_; }
  std::int64_t key() const { return key_; }
  bool loaded() const { return key_ != 0; }
  void load(StoredBoot stored);

  // A Hello with these numbers is of a boot that went on, not of another one with the same id.
  bool continues(std::uint64_t next_seq, std::uint64_t robot_time_us) const;
  // The robot has connected, holding the samples [hello.oldest_seq, hello.next_seq). What it held no more when it
  // first connected after a restore, in the same boot, was lost by that; restored_at_us is 0 when there was none. What
  // else is missing and was acknowledged to it, another store had, or this one before it lost commits.
  void connect(const station::AdmissionRequest& hello, std::int64_t restored_at_us);

  // Samples of the batch that are not here yet.
  std::size_t count_new(const station::SampleBatch& batch) const;
  // Adds them to the waiting segments. `robot_now_us`: the robot's clock as its frames show it.
  void append(const station::SampleBatch& batch, std::uint64_t robot_now_us, std::int64_t steady_us);
  // There is no room: the samples stay missing and are asked for again.
  void refuse(const station::SampleBatch& batch);
  // The robot no longer holds what is missing below.
  void set_lost_below(std::uint64_t oldest_seq, const char* cause, std::int64_t utc_us);
  // These came and cannot be recorded.
  void set_lost(Interval samples, const char* cause, std::int64_t utc_us);
  void set_event_lost(std::uint64_t event_seq, const char* cause, std::int64_t utc_us);
  // Of these samples, those that were made and are not here. To give them up makes them lost: those that come all the
  // same are dropped.
  std::vector<Interval> missing(Interval samples) const { return received_.missing(made(samples)); }
  void give_up(Interval samples, std::int64_t utc_us);
  // Of the batch's samples, those that were given up.
  std::uint64_t count_given_up(const station::SampleBatch& batch) const;
  // Samples that were given up and that the robot still held when it connected last, unless it did so before;
  // ascending.
  const std::vector<Interval>& returned() const { return returned_; }
  // False for an event that is here already.
  bool append_event(std::uint64_t event_seq);
  // There is no room: the event stays missing and is asked for again.
  void refuse_event(std::uint64_t event_seq);
  void set_events_lost_below(std::uint64_t oldest_event_seq, const char* cause, std::int64_t utc_us);

  // A waiting segment is complete: nothing can be added to it.
  bool has_complete() const { return complete_ > 0; }
  // Gaps wait, or an event was received since the last move_gaps().
  bool has_records() const { return !waiting_gaps_.empty() || !waiting_event_gaps_.empty() || has_new_events_; }
  // Since when the oldest waiting sample waits.
  std::int64_t waiting_since_us() const { return waiting_since_us_; }

  // Removes and returns the waiting segments: all, or up to the last complete one.
  std::vector<Segment> take_segments(bool all);
  // Moves the gaps into the commit that is being built.
  void move_gaps(WriteBatch& batch);
  // The segment goes into the commit that is being built.
  void set_committed(const Segment& segment);
  // What is durable once that commit is, when no event is left out of it.
  BootProgress progress() const;
  // It is.
  void set_durable(const BootProgress& progress);

  // A sample or an event is missing that the robot may still hold.
  bool has_hole() const { return misses_samples() || misses_events(); }
  // The missing samples that are to be asked for now, and whether the missing events are.
  std::optional<Interval> overdue_samples(std::int64_t steady_us);
  bool has_overdue_events(std::int64_t steady_us);

  // Whether samples may still be added to a waiting segment.
  bool may_grow(const Segment& waiting) const;
  // Received, and not enqueued yet; in the order of arrival.
  const std::vector<Segment>& waiting() const { return waiting_; }
  const std::vector<LostRange>& waiting_gaps() const { return waiting_gaps_; }

  std::uint64_t next_seq() const { return next_seq_; }
  std::uint64_t next_event_seq() const { return next_event_seq_; }
  std::int64_t connected_at_us() const { return connected_at_us_; }  // UTC, the latest time; 0: never
  std::uint64_t durable_next_seq() const { return durable_next_seq_; }
  std::uint64_t durable_next_event_seq() const { return durable_next_event_seq_; }

 private:
  Interval made(Interval samples) const { return {samples.first, std::min(samples.next, next_seq_)}; }
  bool misses_samples() const { return received_.first_hole() < next_seq_; }
  bool misses_events() const { return received_events_.first_hole() < next_event_seq_; }
  std::uint64_t room_from(std::uint64_t seq) const;
  void append_part(const station::SampleBatch& batch, Interval part, std::int64_t steady_us);
  std::size_t segment_for(const station::SampleBatch& batch, std::uint64_t seq);

  station::RobotId robot_id_;
  std::int64_t key_ = 0;
  std::uint64_t next_seq_ = 0;
  std::uint64_t last_robot_time_us_ = 0;
  std::int64_t connected_at_us_ = 0;  // UTC, the latest time

  std::uint64_t next_event_seq_ = 0;           // every event below it was made
  std::uint64_t committed_robot_time_us_ = 0;  // of the newest committed sample
  std::uint64_t durable_next_seq_ = 0;
  std::uint64_t durable_next_event_seq_ = 0;

  IntervalSet received_;
  IntervalSet committed_;
  IntervalSet refused_;
  IntervalSet given_up_;       // part of received_
  IntervalSet ever_returned_;  // part of given_up_
  std::vector<Interval> returned_;
  IntervalSet received_events_;
  IntervalSet refused_events_;

  std::vector<Segment> waiting_;
  std::size_t complete_ = 0;  // how many of them, up to the last complete one
  std::int64_t waiting_since_us_ = 0;
  std::int64_t completed_at_us_ = 0;
  bool has_new_events_ = false;
  std::vector<LostRange> waiting_gaps_;
  std::vector<LostRange> waiting_event_gaps_;

  HoleWatch sample_hole_;
  HoleWatch event_hole_;
};

}  // namespace server::storage
