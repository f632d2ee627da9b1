// One boot of a robot as the recorder sees it: what is here, what waits to be written, what is still missing.
//
// Loop thread only; owned by the Recorder. Plain bookkeeping: it neither waits nor writes. Times are the caller's.
//
//   received = written + being written + waiting (samples and known gaps)      durable = written
//   next_seq ≥ received.end(): every sample below it was made by the robot
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "server/recording/sample_store.hpp"

namespace server {

class BootRecording {
 public:
  explicit BootRecording(RobotId robot_id) : robot_id_{std::move(robot_id)} {}

  const RobotId& robot_id() const { return robot_id_; }
  std::int64_t key() const { return key_; }
  bool loaded() const { return key_ != 0; }
  void load(StoredBoot stored);

  // A Hello with these numbers is of a boot that went on, not of another one with the same id.
  bool continues(std::uint64_t next_seq, std::uint64_t robot_time_us) const;
  // The robot has connected, holding the samples [oldest_seq, hello.announced_next_seq).
  void connect(const BootStart& hello, std::uint64_t oldest_seq);

  // Samples of the batch that are not here yet.
  std::size_t count_new(const SampleBatch& batch) const;
  // Takes them into the waiting segments.
  void append(const SampleBatch& batch, std::int64_t steady_us);
  // There is no room: the samples stay missing and are asked for again.
  void refuse(const SampleBatch& batch);
  // The robot no longer holds what is missing below.
  void give_up_below(std::uint64_t oldest_seq, const char* cause, std::int64_t utc_us);
  // False for an event that is here already.
  bool append_event(std::uint64_t event_seq);
  void give_up_events_below(std::uint64_t oldest_event_seq, std::int64_t utc_us);

  // Hands over the waiting segments when they are 100 samples or `max_age_us` old, and the gaps.
  void take(WriteBatch& batch, std::int64_t steady_us, std::int64_t max_age_us);
  // What was taken is stored.
  void set_durable(Interval samples) { durable_.insert(samples); }
  void set_durable_events(Interval events) { durable_events_.insert(events); }

  // The first missing range that the robot may still hold, when it was the same for `patience_us`.
  std::optional<Interval> overdue(std::int64_t steady_us, std::int64_t patience_us, std::int64_t repeat_us);

  // Heard, and not taken yet; in the order of arrival.
  const std::vector<Segment>& waiting() const { return waiting_; }
  const std::vector<LostRange>& waiting_gaps() const { return waiting_gaps_; }

  std::uint64_t next_seq() const { return next_seq_; }
  std::uint64_t durable_next_seq() const { return durable_.first_hole(); }
  std::uint64_t durable_next_event_seq() const { return durable_events_.first_hole(); }
  bool all_durable() const;

 private:
  void append_part(const SampleBatch& batch, Interval part);
  Segment& segment_for(const SampleBatch& batch, std::uint64_t seq);

  RobotId robot_id_;
  std::int64_t key_ = 0;
  std::uint64_t next_seq_ = 0;
  std::uint64_t last_robot_time_us_ = 0;

  IntervalSet received_;
  IntervalSet durable_;
  IntervalSet refused_;
  IntervalSet received_events_;
  IntervalSet durable_events_;

  std::vector<Segment> waiting_;
  std::size_t waiting_samples_ = 0;
  std::int64_t waiting_since_us_ = 0;
  std::vector<LostRange> waiting_gaps_;
  std::vector<LostRange> waiting_event_gaps_;

  std::optional<Interval> hole_;  // the first missing range at the last look
  std::int64_t hole_since_us_ = 0;
  std::optional<std::int64_t> asked_at_us_;
};

}  // namespace server
