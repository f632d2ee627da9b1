// What one run of a profile commands, tick by tick. Pure.
#pragma once

#include <cstdint>
#include <vector>

#include "server/experiments/profile.hpp"

namespace server::experiments {

// 0.5 s without another command after a change between manual and auto.
inline constexpr std::uint64_t kModeChangeTicks = 50;

enum class ActionKind : std::uint8_t { duty, setpoint, disturbance };  // a duty: manual; a setpoint: auto

struct Action {
  std::uint64_t tick = 0;  // of the run
  ActionKind kind = ActionKind::duty;
  double value = 0;  // duty, or m; with the factors of the variant
  std::size_t step = 0;
  bool operator==(const Action&) const = default;
};

struct TimeLine {
  std::vector<Action> actions;             // by tick; the last one sets duty 0 if a duty step ends the profile
  std::vector<std::uint64_t> step_begins;  // tick of each step of profile_of_run()
  std::uint64_t ticks = 0;                 // of the run
  std::size_t first_step = 1;              // the number of its first step in the profile
  double duration_s() const { return static_cast<double>(ticks) * kTick_s; }
};

// A scan begins at the setpoint before it, or at 0. A step in the other mode than the one before it begins with
// kModeChangeTicks at duty 0 or at the beginning of its scan; a setpoint is kept for as long.
TimeLine time_line_of(const Profile& profile, const Variant& variant);

// The duration of the longest of all variants.
double longest_duration_s(const Profile& profile);

}  // namespace server::experiments
