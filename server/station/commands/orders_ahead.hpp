// Orders on their way to a robot, or waiting there: the setpoints that a new one must fit between, and the time at
// power that they use. Pure.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "server/config/envelope.hpp"
#include "server/runtime/result.hpp"
#include "server/station/state/station_state.hpp"

namespace server::station {

struct OrderAhead {
  const protocol::Command* command = nullptr;
  std::uint64_t from_robot_us = 0, until_robot_us = 0;  // it acts between these times, or never
  bool is_held = false;  // the robot has acknowledged it, and its time, which is from_robot_us, is still to come
  std::uint64_t sampled_us = 0;  // of a schedule that runs: samples show it so far, and until_robot_us is its end
};
using OrdersAhead = std::vector<OrderAhead>;

bool is_schedule(const protocol::Command& command);
std::optional<double> setpoint_of(const protocol::Command& command);

// Setpoints are floats on the way: a step of just the limit is not too large.
bool is_too_large(double step_m, const config::CommandLimits& limits);

// When the command acts that the robot has not acknowledged: from its time on, or from now, until its time to live
// ends.
OrderAhead unanswered_order(const protocol::Command& command, std::uint64_t robot_now_us);

// SAFETY: no two setpoints of which one may follow the other are farther apart than the largest step. Every order may
// follow every other, and the setpoint in force or else the position, unless one that the robot holds lies between
// their times.
Result<void> check_steps(const protocol::Command& command, const OrdersAhead& ahead, const RobotState& robot,
                         const config::CommandLimits& limits);

// From its effect on; 0 for anything but a schedule.
std::uint64_t schedule_length_us(const protocol::Command& command, std::uint32_t tick_us);

// How long the motor runs at power by this command alone: a duty for its lease, a schedule for the entries above the
// limit that come after `sampled_us` of it.
double at_power_s(const protocol::Command& command, std::uint32_t tick_us, const config::CommandLimits& limits,
                  std::uint64_t sampled_us = 0);

// The same, of all that is to act at a time of its own, and of every schedule, as far as it is still to run.
double at_power_ahead_s(const OrdersAhead& ahead, std::uint32_t tick_us, const config::CommandLimits& limits);

}  // namespace server::station
