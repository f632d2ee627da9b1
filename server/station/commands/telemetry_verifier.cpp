// One comparison a kind of command, over the samples that were made after its effect.
#include "server/station/commands/telemetry_verifier.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace server::station {
namespace {

constexpr float kSameDuty = 0.001F;  // a duty is a float on its whole way

// How many of the batch were made before the time.
std::size_t samples_before(const SampleBatch& batch, std::uint64_t robot_time_us) {
  if (batch.first_robot_time_us >= robot_time_us) return 0;
  const std::uint64_t period_us = std::max<std::uint64_t>(batch.context.period_us, 1);
  const std::uint64_t before = (robot_time_us - batch.first_robot_time_us + period_us - 1) / period_us;
  return std::min<std::uint64_t>(before, batch.samples.size());
}

// Made at or after the time.
std::span<const Sample> samples_from(const SampleBatch& batch, std::uint64_t robot_time_us) {
  return std::span<const Sample>{batch.samples}.subspan(samples_before(batch, robot_time_us));
}

// The first entry of a schedule that moves the motor; the last when none does.
std::size_t first_move(const rheonaut_SetDutySchedule& schedule) {
  std::size_t first = 0;
  while (first + 1 < schedule.duty_count && schedule.duty[first] == 0.0F) ++first;
  return first;
}

bool is_shown(const protocol::Command& command, std::uint64_t emergency_id, const SampleContext& context,
              std::span<const Sample> samples) {
  const auto has_duty = [samples](float duty) {
    return std::ranges::any_of(samples, [duty](const Sample& one) { return std::abs(one.duty - duty) <= kSameDuty; });
  };
  const bool is_auto = context.mode == rheonaut_MODE_AUTO;
  switch (command.which_action) {
    case rheonaut_Command_set_mode_tag: {
      const auto& wanted = command.action.set_mode;
      return context.mode == wanted.mode && (!wanted.has_setpoint_m || context.setpoint_m == wanted.setpoint_m);
    }
    case rheonaut_Command_set_setpoint_tag:
      return is_auto && context.setpoint_m == command.action.set_setpoint.setpoint_m;
    case rheonaut_Command_set_duty_tag: return !is_auto && has_duty(command.action.set_duty.duty);
    case rheonaut_Command_set_duty_schedule_tag: {
      const auto& schedule = command.action.set_duty_schedule;
      return has_duty(schedule.duty[first_move(schedule)]);
    }
    case rheonaut_Command_emergency_stop_tag: {
      const bool is_off = std::ranges::any_of(samples, [](const Sample& one) { return one.duty == 0.0F; });
      return context.emergency_id != 0 && is_off;
    }
    case rheonaut_Command_clear_emergency_tag: return context.emergency_id == emergency_id;
    case rheonaut_Command_inject_disturbance_tag:
      return context.disturbance_m == command.action.inject_disturbance.disturbance_m;
    default: return false;
  }
}

}  // namespace

std::uint64_t visible_from_us(const protocol::Command& command, std::uint64_t effect_at_robot_us,
                              std::uint32_t period_us) {
  if (command.which_action != rheonaut_Command_set_duty_schedule_tag) return effect_at_robot_us;
  const auto& schedule = command.action.set_duty_schedule;
  return effect_at_robot_us + std::uint64_t{schedule.tick[first_move(schedule)]} * period_us;
}

bool is_shown_between(const protocol::Command& command, std::uint64_t from_robot_us, std::uint64_t until_robot_us,
                      const SampleBatch& batch) {
  const std::size_t first = samples_before(batch, from_robot_us), end = samples_before(batch, until_robot_us);
  if (first >= end) return false;
  return is_shown(command, 0, batch.context, std::span<const Sample>{batch.samples}.subspan(first, end - first));
}

bool can_be_seen(const protocol::Command& command) {
  switch (command.which_action) {
    case rheonaut_Command_set_mode_tag:
    case rheonaut_Command_set_setpoint_tag:
    case rheonaut_Command_set_duty_tag:
    case rheonaut_Command_set_duty_schedule_tag:
    case rheonaut_Command_emergency_stop_tag:
    case rheonaut_Command_clear_emergency_tag:
    case rheonaut_Command_inject_disturbance_tag: return true;
    default: return false;
  }
}

bool is_for_the_motor(const protocol::Command& command) {
  switch (command.which_action) {
    case rheonaut_Command_set_mode_tag:
    case rheonaut_Command_set_setpoint_tag:
    case rheonaut_Command_set_duty_tag:
    case rheonaut_Command_set_duty_schedule_tag:
    case rheonaut_Command_inject_disturbance_tag:
    case rheonaut_Command_emergency_stop_tag:
    case rheonaut_Command_clear_emergency_tag: return true;
    default: return false;
  }
}

Sight look_for(const protocol::Command& command, std::uint64_t effect_at_robot_us, std::uint64_t emergency_id,
               const SampleBatch& batch) {
  const std::uint64_t from_us = visible_from_us(command, effect_at_robot_us, batch.context.period_us);
  const std::span<const Sample> samples = samples_from(batch, from_us);
  if (samples.empty()) return Sight::unseen;
  if (is_shown(command, emergency_id, batch.context, samples)) return Sight::seen;
  const bool is_stop = command.which_action == rheonaut_Command_emergency_stop_tag;
  if (!is_stop && batch.context.emergency_id != emergency_id) return Sight::overtaken;
  const std::uint64_t last_us = batch.first_robot_time_us + (batch.samples.size() - 1) * batch.context.period_us;
  return last_us >= from_us + kVerifyWindowUs ? Sight::missed : Sight::unseen;
}

}  // namespace server::station
