// A sample as it was recorded, with the context it was made in.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "server/station/state/station_state.hpp"
#include "server/storage/samples/segment.hpp"

namespace server {

struct StoredSample {
  std::uint32_t span = 0;  // index of the run's span
  BootId boot_id = 0;
  std::uint64_t seq = 0;
  std::uint64_t robot_time_us = 0;
  std::int64_t utc_us = 0;                 // robot time + the clock estimate stored with it
  std::int64_t clock_uncertainty_us = -1;  // half-width of that estimate; -1: there was none
  std::int64_t first_received_at_us = 0;  // it arrived between these two: the arrivals of the first and the last sample
  std::int64_t received_at_us = 0;        // of its segment, which spans at most 1 s
  Sample sample;
  protocol::Mode mode = rheonaut_MODE_UNSPECIFIED;
  protocol::SubState sub_state = rheonaut_SUB_STATE_NONE;
  std::optional<float> setpoint_m;
  float disturbance_m = 0;  // this and the next: NaN where there is no finite number
  float position_sd_m = 0;
  std::uint32_t controller_id = 0;
  std::uint64_t emergency_id = 0;  // 0: not latched
  protocol::EmergencyCause emergency_cause = rheonaut_EMERGENCY_CAUSE_NONE;
  std::uint32_t flags = 0;  // TelemetryFlag
};

// The sample number `index` of a segment.
StoredSample stored_sample(const Segment& segment, std::size_t index, std::uint32_t span, BootId boot_id);

}  // namespace server
