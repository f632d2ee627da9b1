// Steps between setpoints in the order of their times, and the time at power of what waits.
#include "server/station/commands/orders_ahead.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace server::station {
namespace {

constexpr auto kWayOut =
    "; what waits is dropped by set_mode manual, by the release of control, or when it is not renewed for 500 ms";

std::unexpected<Error> too_large(double setpoint_m, double from_m, const std::string& from, const char* way_out,
                                 const config::CommandLimits& limits) {
  return fail(
      ErrorCode::invalid,
      fmt::format("setpoint_m = {} is {:.3f} m from {}; a step is at most {} m{}", static_cast<float>(setpoint_m),
                  std::abs(setpoint_m - from_m), from, limits.setpoint_step_m, way_out),
      "step_too_large");
}

bool has_held_between(const OrdersAhead& ahead, std::uint64_t after_us, std::uint64_t before_us) {
  return std::ranges::any_of(ahead, [after_us, before_us](const OrderAhead& one) {
    return one.is_held && setpoint_of(*one.command) && after_us < one.from_robot_us && one.from_robot_us < before_us;
  });
}

// Without a setpoint in force the step is counted from where the robot is, as far as that is known.
Result<void> check_step_from_now(double setpoint_m, const RobotState& robot, const config::CommandLimits& limits) {
  const bool is_steered = robot.context.mode == rheonaut_MODE_AUTO && robot.context.setpoint_m;
  if (!is_steered && !robot.sample) return {};
  const double from_m = is_steered ? *robot.context.setpoint_m : robot.sample->position_m;
  if (!is_too_large(std::abs(setpoint_m - from_m), limits)) return {};
  const std::string from = fmt::format("{} {:.3f}", is_steered ? "the setpoint" : "the position", from_m);
  return too_large(setpoint_m, from_m, from, "", limits);
}

std::string described(double setpoint_m, const OrderAhead& order) {
  if (!order.command->has_execute_at_robot_us) return fmt::format("the setpoint {:.3f} on its way", setpoint_m);
  return fmt::format("the setpoint {:.3f} that waits for execute_at_robot_us = {}", setpoint_m,
                     order.command->execute_at_robot_us);
}

}  // namespace

bool is_schedule(const protocol::Command& command) {
  return command.which_action == rheonaut_Command_set_duty_schedule_tag;
}

bool is_too_large(double step_m, const config::CommandLimits& limits) {
  return std::isfinite(step_m) && step_m > limits.setpoint_step_m + 1e-6;
}

std::optional<double> setpoint_of(const protocol::Command& command) {
  if (command.which_action == rheonaut_Command_set_setpoint_tag) return command.action.set_setpoint.setpoint_m;
  const bool is_auto =
      command.which_action == rheonaut_Command_set_mode_tag && command.action.set_mode.mode == rheonaut_MODE_AUTO;
  return is_auto ? std::optional<double>{command.action.set_mode.setpoint_m} : std::nullopt;
}

OrderAhead unanswered_order(const protocol::Command& command, std::uint64_t robot_now_us) {
  OrderAhead order{&command, robot_now_us};
  if (command.has_execute_at_robot_us) order.from_robot_us = std::max(robot_now_us, command.execute_at_robot_us);
  order.until_robot_us = command.valid_until_robot_us;
  order.from_robot_us = std::min(order.from_robot_us, order.until_robot_us);  // expired: it has acted
  return order;
}

Result<void> check_steps(const protocol::Command& command, const OrdersAhead& ahead, const RobotState& robot,
                         const config::CommandLimits& limits) {
  const auto setpoint_m = setpoint_of(command);
  if (!setpoint_m) return {};
  const OrderAhead order = unanswered_order(command, robot.latest_robot_time_us);
  if (!has_held_between(ahead, 0, order.from_robot_us)) {
    if (auto checked = check_step_from_now(*setpoint_m, robot, limits); !checked) return checked;
  }
  for (const OrderAhead& other : ahead) {
    const auto other_m = setpoint_of(*other.command);
    if (!other_m || !is_too_large(std::abs(*setpoint_m - *other_m), limits)) continue;
    const bool is_apart = has_held_between(ahead, order.until_robot_us, other.from_robot_us) ||
                          has_held_between(ahead, other.until_robot_us, order.from_robot_us);
    if (is_apart) continue;
    const bool is_timed = other.command->has_execute_at_robot_us;
    return too_large(*setpoint_m, *other_m, described(*other_m, other), is_timed ? kWayOut : "", limits);
  }
  return {};
}

std::uint64_t schedule_length_us(const protocol::Command& command, std::uint32_t tick_us) {
  if (!is_schedule(command) || command.action.set_duty_schedule.tick_count == 0) return 0;
  const auto& schedule = command.action.set_duty_schedule;
  return std::uint64_t{schedule.tick[schedule.tick_count - 1]} * tick_us;
}

double at_power_s(const protocol::Command& command, std::uint32_t tick_us, const config::CommandLimits& limits,
                  std::uint64_t sampled_us) {
  const auto is_at_power = [&limits](double duty) { return std::abs(duty) > limits.power_duty; };
  if (command.which_action == rheonaut_Command_set_duty_tag) {
    const auto& order = command.action.set_duty;
    const std::uint32_t lease_ms = order.lease_ms == 0 ? protocol::kLeaseMs : order.lease_ms;
    return is_at_power(order.duty) ? lease_ms / 1e3 : 0;
  }
  if (!is_schedule(command)) return 0;
  const auto& schedule = command.action.set_duty_schedule;
  std::uint64_t sum_us = 0;  // the last duty ends it
  for (pb_size_t i = 0; i + 1 < std::min(schedule.duty_count, schedule.tick_count); ++i) {
    const std::uint64_t from_us = std::max(std::uint64_t{schedule.tick[i]} * tick_us, sampled_us);
    const std::uint64_t until_us = std::uint64_t{schedule.tick[i + 1]} * tick_us;
    if (is_at_power(schedule.duty[i]) && from_us < until_us) sum_us += until_us - from_us;
  }
  return static_cast<double>(sum_us) / 1e6;
}

double at_power_ahead_s(const OrdersAhead& ahead, std::uint32_t tick_us, const config::CommandLimits& limits) {
  double sum_s = 0;
  for (const OrderAhead& order : ahead) {
    if (!order.command->has_execute_at_robot_us && !is_schedule(*order.command)) continue;
    sum_s += at_power_s(*order.command, tick_us, limits, order.sampled_us);
  }
  return sum_s;
}

}  // namespace server::station
