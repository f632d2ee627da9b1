// Cutting of segments, and what SQLite makes of a number.
#include "server/storage/samples/segment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace server::storage {
namespace {

// SQLite stores NaN as NULL and -0.0 as 0.0; the store writes an infinity as NULL, too.
float as_stored(float value) { return std::isfinite(value) ? value + 0.0F : std::numeric_limits<float>::quiet_NaN(); }

}  // namespace

Segment part_of(const Segment& segment, Interval range) {
  const std::uint64_t first = std::max(segment.first_seq, range.first);
  const std::uint64_t next = std::min(segment.next_seq(), range.next);
  const std::uint64_t skipped = first - segment.first_seq;
  const auto begin = segment.samples.begin() + static_cast<std::ptrdiff_t>(skipped);
  Segment part;
  part.boot_key = segment.boot_key;
  part.first_seq = first;
  part.first_robot_time_us = segment.robot_time_us(skipped);
  part.context = segment.context;
  part.samples.assign(begin, begin + static_cast<std::ptrdiff_t>(next - first));
  part.first_received_at_us = segment.first_received_at_us;
  part.received_at_us = segment.received_at_us;
  part.utc_offset_us = segment.utc_offset_us;
  part.clock_uncertainty_us = segment.clock_uncertainty_us;
  return part;
}

Tick first_tick(const Segment& segment) {
  return {segment.first_seq, segment.first_robot_time_us, segment.context.period_us};
}

Tick last_tick(const Segment& segment) {
  const std::size_t last = segment.samples.size() - 1;
  return {segment.first_seq + last, segment.robot_time_us(last), segment.context.period_us};
}

std::uint64_t missed_ticks(const Tick& before, const Tick& after) {
  const std::uint64_t period_us = std::max(before.period_us, after.period_us);
  if (period_us == 0 || after.robot_time_us <= before.robot_time_us) return 0;
  const std::uint64_t ticks = (after.robot_time_us - before.robot_time_us + period_us / 2) / period_us;
  const std::uint64_t made = after.seq - before.seq;
  return ticks > made ? ticks - made : 0;
}

station::Sample as_stored(const station::Sample& sample) {
  station::Sample stored;
  station::for_each_sample_field(
      [&](const station::SampleField& field) { stored.*field.member = as_stored(sample.*field.member); });
  return stored;
}

}  // namespace server::storage
