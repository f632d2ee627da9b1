// Whether telemetry shows the effect of a command. Pure.
#pragma once

#include "server/station/state/station_state.hpp"

namespace server::station {

// Telemetry of at most this much robot time after the effect must show it.
inline constexpr std::uint64_t kVerifyWindowUs = 500'000;

// False for what no sample can show: a lease, a ping, the position's zero, what is read back.
bool can_be_seen(const protocol::Command& command);

// True when the robot's motor may run differently after it: another one of these takes its place.
bool is_for_the_motor(const protocol::Command& command);

// From when on samples can show it. A schedule is seen by its first motion, which comes at a tick of its own.
std::uint64_t visible_from_us(const protocol::Command& command, std::uint64_t effect_at_robot_us,
                              std::uint32_t period_us);

// Whether a sample of [from, until) shows what the command was to bring about.
bool is_shown_between(const protocol::Command& command, std::uint64_t from_robot_us, std::uint64_t until_robot_us,
                      const SampleBatch& batch);

enum class Sight : std::uint8_t {
  unseen,    // the batch was made too early, or shows something else within the window
  seen,      //
  missed,    // the window has passed
  overtaken  // something newer has taken the place of what was ordered: of what telemetry shows, an emergency
};

// What the batch says of a command that took effect at this time, and left this latch (emergency_id), as the robot
// answered. A stop is seen in a sample with duty 0 of a robot that is latched.
Sight look_for(const protocol::Command& command, std::uint64_t effect_at_robot_us, std::uint64_t emergency_id,
               const SampleBatch& batch);

}  // namespace server::station
