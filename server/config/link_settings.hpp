// Settings of the robots' port: the times of a link, and which robots may enrol themselves.
#pragma once

#include <cstdint>

#include "protocol/messages.hpp"

namespace server::config {

// What every robot is given in its Welcome.
struct LinkTimes {
  std::uint32_t link_timeout_ms = protocol::kDefaultLinkTimeoutMs;
  std::uint32_t heartbeat_interval_ms = protocol::kDefaultHeartbeatIntervalMs;
  std::uint32_t samples_per_frame = 0;  // 0: as each robot has it
};

// Robots that nobody has enrolled and that dial in from this machine enrol themselves, within these bounds.
struct LoopbackEnrolment {
  bool allowed = true;
  std::uint32_t most_robots = 64;  // enrolled so, and not revoked
  std::uint32_t most_a_minute = 10;
};

}  // namespace server::config
