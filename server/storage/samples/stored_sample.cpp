// A segment's common values written out for one of its samples.
#include "server/storage/samples/stored_sample.hpp"

namespace server::storage {

StoredSample stored_sample(const Segment& segment, std::size_t index, std::uint32_t span, station::BootId boot_id) {
  StoredSample stored;
  static_cast<station::SampleContext&>(stored) = segment.context;
  stored.span = span;
  stored.boot_id = boot_id;
  stored.seq = segment.first_seq + index;
  stored.robot_time_us = segment.robot_time_us(index);
  stored.utc_us = static_cast<std::int64_t>(stored.robot_time_us) + segment.utc_offset_us;
  stored.clock_uncertainty_us = segment.clock_uncertainty_us;
  stored.first_received_at_us = segment.first_received_at_us;
  stored.received_at_us = segment.received_at_us;
  stored.sample = segment.samples[index];
  return stored;
}

}  // namespace server::storage
