// Samples that belong together, and ranges of samples that are lost: what the recorder hands to the disk, and what is
// read back from it.
//
// Plain values, the same whether they wait in memory or are stored.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/station/state/station_state.hpp"
#include "server/storage/samples/interval_set.hpp"

namespace server::storage {

// 1 to 100 consecutive samples that share everything but their values.
struct Segment {
  std::int64_t boot_key = 0;
  std::uint64_t first_seq = 0;
  std::uint64_t first_robot_time_us = 0;
  station::SampleContext context;
  std::vector<station::Sample> samples;
  std::int64_t first_received_at_us = 0;  // UTC, when the first of them had arrived
  std::int64_t received_at_us = 0;        // UTC, when the last of them had arrived; 0: others may still follow it
  std::int64_t utc_offset_us = 0;
  std::int64_t clock_uncertainty_us = -1;

  std::uint64_t next_seq() const { return first_seq + samples.size(); }
  Interval interval() const { return {first_seq, next_seq()}; }
  std::uint64_t robot_time_us(std::size_t index) const { return first_robot_time_us + index * context.period_us; }
};

// The samples of the segment in a range that holds at least one of them. Times of receipt stay those of the segment.
Segment part_of(const Segment& segment, Interval range);

// A tick of the robot's loop at which it made a sample.
struct Tick {
  std::uint64_t seq = 0;
  std::uint64_t robot_time_us = 0;
  std::uint32_t period_us = 0;
};
Tick first_tick(const Segment& segment);
Tick last_tick(const Segment& segment);

// How many ticks the robot missed between two samples of one boot: it made no sample there, so none is lost. Where the
// period changed in between, the longer one counts. Times are right to a fraction of a period.
std::uint64_t missed_ticks(const Tick& before, const Tick& after);

// The sample as the database gives it back: NaN for what is not finite, and no negative zero.
station::Sample as_stored(const station::Sample& sample);

// Samples (or events) that are lost for good.
struct LostRange {
  std::int64_t boot_key = 0;
  Interval lost;
  std::string cause;
  std::int64_t noticed_at_us = 0;  // UTC
};

}  // namespace server::storage
