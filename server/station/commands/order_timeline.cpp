#include "server/station/commands/order_timeline.hpp"

#include <algorithm>
#include <cmath>

namespace server::station {
namespace {

// The lease of what waits, and what the station may know too late of the robot's time.
constexpr std::uint64_t kDroppedAheadUs = protocol::kLeaseMs * 1000 + 200'000;
constexpr std::size_t kMaxSchedules = 64;

// SAFETY: what is to be dropped may act before the drop arrives. Only the lease that all that wait have in common ends
// it for certain, unless something that extends the lease is on its way, too.
bool is_dropped_in_time(const RobotState& robot, const RobotCommands& commands, const PendingCommand& pending,
                        std::uint64_t at_robot_us) {
  if (pending.dropped_because == nullptr) return false;
  const bool is_renewed = std::ranges::any_of(commands.unanswered, [](const auto& entry) {
    const protocol::Command& wire = entry.second->wire;
    return wire.which_action == rheonaut_Command_renew_lease_tag || wire.has_execute_at_robot_us;
  });
  return !is_renewed && at_robot_us > robot.latest_robot_time_us + kDroppedAheadUs;
}

bool is_accepted_schedule(const PendingCommand& pending) {  // which stands in schedules_ until it has ended
  return is_schedule(pending.wire) && pending.record.acknowledged_after_us >= 0;
}

}  // namespace

void OrderTimeline::note_samples(std::uint64_t next_sample_at_robot_us) {
  next_sample_at_robot_us_ = next_sample_at_robot_us;
  std::erase_if(schedules_,
                [this](const AcceptedSchedule& one) { return one.until_robot_us <= next_sample_at_robot_us_; });
}

// The link keeps the order: what was sent before a command that the robot has accepted came before it, or never came.
bool OrderTimeline::is_over(const PendingCommand& unanswered) const {
  const protocol::Command& wire = unanswered.wire;
  if (wire.has_execute_at_robot_us) return setpoint_of(wire) && unanswered.number < timed_dropped_by_;
  return is_schedule(wire) && unanswered.number < schedules_ended_by_;
}

// A command without an answer has acted by the end of its time to live, if ever; an answered one at the answer's time.
OrdersAhead OrderTimeline::ahead(const RobotState& robot, const RobotCommands& commands,
                                 const protocol::Command* newer) const {
  OrdersAhead orders;
  const std::uint64_t now_us = robot.latest_robot_time_us;
  const std::uint32_t tick_us = robot.sample_period_us;
  const auto add = [this, &robot, &commands, &orders](const PendingCommand& pending, OrderAhead order) {
    // SAFETY: a sample of the very time at which an order was taken was made before it, and does not show it.
    const bool is_shown = order.until_robot_us + robot.sample_period_us < next_sample_at_robot_us_;
    if (!is_shown && !is_dropped_in_time(robot, commands, pending, order.from_robot_us)) orders.push_back(order);
  };
  const auto add_unanswered = [&add, now_us, tick_us](const PendingCommand& pending) {
    OrderAhead order = unanswered_order(pending.wire, now_us);
    order.until_robot_us += schedule_length_us(pending.wire, tick_us);
    add(pending, order);
  };
  for (const AcceptedSchedule& one : schedules_) {
    const std::uint64_t from_us = one.pending->look_from_robot_us;
    const std::uint64_t sampled_us = next_sample_at_robot_us_ - std::min(from_us, next_sample_at_robot_us_);
    add(*one.pending, {&one.pending->wire, from_us, one.until_robot_us, false, sampled_us});
  }
  for (const auto& [id, pending] : commands.unanswered) {
    const bool is_taken_back = newer != nullptr && is_superseded_by(*pending, *newer);
    if (!is_taken_back) add_unanswered(*pending);
  }
  for (const auto& pending : commands.unknown) {
    if (!is_accepted_schedule(*pending) && !is_over(*pending)) add_unanswered(*pending);
  }
  for (const auto& pending : commands.unseen) {
    if (is_accepted_schedule(*pending)) continue;
    const std::uint64_t at_us = pending->look_from_robot_us;
    add(*pending, {&pending->wire, at_us, at_us, at_us > now_us && pending->dropped_because == nullptr});
  }
  return orders;
}

void OrderTimeline::note_accepted(const std::shared_ptr<PendingCommand>& accepted, std::uint32_t tick_us) {
  const protocol::Command& wire = accepted->wire;
  const bool is_for_now = !wire.has_execute_at_robot_us && accepted->record.effect_at_robot_us != 0;
  const bool ends_schedule = wire.which_action == rheonaut_Command_set_duty_tag ||
                             wire.which_action == rheonaut_Command_set_mode_tag || is_schedule(wire);
  if (is_for_now && ends_schedule) {
    schedules_ended_by_ = std::max(schedules_ended_by_, accepted->number);
    end_schedules(accepted->look_from_robot_us + 1);  // also one that the robot has read together with it
  }
  if (wire.which_action == rheonaut_Command_drop_timed_tag) {
    timed_dropped_by_ = std::max(timed_dropped_by_, accepted->number);
  }
  if (!is_schedule(wire)) return;
  drop_schedule(accepted->record.id);
  if (schedules_.size() >= kMaxSchedules) schedules_.pop_front();
  const std::uint64_t length_us = schedule_length_us(wire, tick_us);
  schedules_.push_back({accepted, accepted->look_from_robot_us + length_us});
}

void OrderTimeline::end_schedules(std::uint64_t at_robot_us) {
  std::erase_if(schedules_,
                [at_robot_us](const AcceptedSchedule& one) { return one.pending->look_from_robot_us < at_robot_us; });
}

void OrderTimeline::note_event(const protocol::Event& event) {
  switch (event.kind) {
    case rheonaut_EVENT_KIND_MODE_CHANGED:
    case rheonaut_EVENT_KIND_EMERGENCY:
    case rheonaut_EVENT_KIND_LINK_LOST:
    case rheonaut_EVENT_KIND_LEASE_LAPSED:
    case rheonaut_EVENT_KIND_POSITION_UNCERTAIN:
    case rheonaut_EVENT_KIND_DUTY_SCHEDULE_ENDED: return end_schedules(event.event_robot_time_us);
    default: return;
  }
}

void OrderTimeline::drop_schedule(CommandId id) {
  std::erase_if(schedules_, [id](const AcceptedSchedule& one) { return one.pending->record.id == id; });
}

bool OrderTimeline::begins_too_far_away(const RobotState& robot, const RobotCommands& commands,
                                        const config::CommandLimits& limits) const {
  if (robot.context.mode == rheonaut_MODE_AUTO || !robot.sample) return false;
  OrdersAhead setpoints = ahead(robot, commands);
  std::erase_if(setpoints, [](const OrderAhead& order) {
    return !order.command->has_execute_at_robot_us || !setpoint_of(*order.command);
  });
  const auto first = std::ranges::min_element(setpoints, {}, &OrderAhead::from_robot_us);
  if (first == setpoints.end()) return false;
  return is_too_large(std::abs(*setpoint_of(*first->command) - robot.sample->position_m), limits);
}

}  // namespace server::station
