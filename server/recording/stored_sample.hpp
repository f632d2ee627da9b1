// A sample as the database gives it back, with the context it was made in.
#pragma once

#include <cstdint>
#include <optional>

#include "server/station/station_state.hpp"

namespace server {

struct StoredSample {
  std::uint32_t span = 0;  // index of the run's span
  BootId boot_id = 0;
  std::uint64_t seq = 0;
  std::uint64_t robot_time_us = 0;
  std::int64_t utc_us = 0;  // robot time + the clock estimate stored with it
  std::int64_t received_at_us = 0;
  Sample sample;
  protocol::Mode mode = rheonaut_MODE_UNSPECIFIED;
  protocol::SubState sub_state = rheonaut_SUB_STATE_NONE;
  std::optional<float> setpoint_m;
  float disturbance_m = 0;
};

}  // namespace server
