// A segment's common values written out for one of its samples.
#include "server/storage/samples/stored_sample.hpp"

#include <limits>

namespace server {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

StoredSample stored_sample(const Segment& segment, std::size_t index, std::uint32_t span, BootId boot_id) {
  const SampleContext& context = segment.context;
  const std::uint64_t robot_time_us = segment.robot_time_us(index);
  return {.span = span,
          .boot_id = boot_id,
          .seq = segment.first_seq + index,
          .robot_time_us = robot_time_us,
          .utc_us = static_cast<std::int64_t>(robot_time_us) + segment.utc_offset_us,
          .clock_uncertainty_us = segment.clock_uncertainty_us,
          .first_received_at_us = segment.first_received_at_us,
          .received_at_us = segment.received_at_us,
          .sample = segment.samples[index],
          .mode = context.mode,
          .sub_state = context.sub_state,
          .setpoint_m = context.setpoint_m,
          .disturbance_m = context.disturbance_m.value_or(kNaN),
          .position_sd_m = context.position_sd_m.value_or(kNaN),
          .controller_id = context.controller_id,
          .emergency_id = context.emergency_id,
          .emergency_cause = context.emergency_cause,
          .flags = context.flags};
}

}  // namespace server
