// Telemetry as the bare loop holds it: what a frame says beside its samples, and groups of up to 100 samples.
#pragma once

#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "tests/bench/bare_wire.hpp"

namespace bare {

inline constexpr std::size_t kChannels = 6;
inline constexpr std::size_t kGroupSamples = 100;

template <class Time>
std::int64_t microseconds(Time now) {
  return std::chrono::duration_cast<std::chrono::microseconds>(now.time_since_epoch()).count();
}
inline std::int64_t steady_us() { return microseconds(std::chrono::steady_clock::now()); }
inline std::int64_t utc_us() { return microseconds(std::chrono::system_clock::now()); }

// What a telemetry frame says beside its samples, and where those lie in it.
struct Telemetry {
  std::uint64_t first_seq = 0, first_robot_time_us = 0, emergency_id = 0;
  std::uint32_t period_us = 0, mode = 0, sub_state = 0, controller_id = 0, flags = 0, cause = 0, padding = 0;
  float setpoint_m = NAN, disturbance_m = 0, position_sd_m = 0;
  std::size_t samples = 0;
  std::array<const std::uint8_t*, kChannels> columns{};

  bool same_context(const Telemetry& other) const {
    return std::memcmp(&emergency_id, &other.emergency_id,
                       offsetof(Telemetry, samples) - offsetof(Telemetry, emergency_id)) == 0;
  }
};

// Up to 100 samples of one context, a row each.
struct Group {
  std::size_t robot = 0;
  Telemetry head;
  std::size_t count = 0;
  std::int64_t first_received_us = 0, received_us = 0, began_us = 0;
  std::array<std::array<float, kChannels>, kGroupSamples> rows;
};

inline void read_telemetry(WireReader in, Telemetry& to) {
  while (in.more()) {
    const std::uint64_t tag = in.varint();
    const std::uint64_t field = tag >> 3;
    if (field >= 16 && field < 16 + kChannels) {
      const WireReader column = in.message();
      to.columns[field - 16] = column.at();
      to.samples = column.size() / sizeof(float);
      continue;
    }
    switch (field) {
      case 1: to.first_seq = in.varint(); break;
      case 2: to.first_robot_time_us = in.varint(); break;
      case 3: to.period_us = static_cast<std::uint32_t>(in.varint()); break;
      case 5: to.mode = static_cast<std::uint32_t>(in.varint()); break;
      case 6: to.sub_state = static_cast<std::uint32_t>(in.varint()); break;
      case 7: to.setpoint_m = in.fixed<float>(); break;
      case 8: to.disturbance_m = in.fixed<float>(); break;
      case 9: to.position_sd_m = in.fixed<float>(); break;
      case 10: to.controller_id = static_cast<std::uint32_t>(in.varint()); break;
      case 11: to.emergency_id = in.fixed<std::uint64_t>(); break;
      case 12: to.flags = static_cast<std::uint32_t>(in.varint()); break;
      case 13: to.cause = static_cast<std::uint32_t>(in.varint()); break;
      default: in.skip_value(tag & 7); break;
    }
  }
}

}  // namespace bare
