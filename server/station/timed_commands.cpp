#include "server/station/timed_commands.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "server/station/commands/command_checks.hpp"

namespace server::station {
namespace {

constexpr std::uint64_t kDueGraceUs = 200'000;  // after its time a timed command has run or is dropped

// A command that only ends motion may still run after control has changed: dropping it could do harm, running it not.
bool only_ends_motion(const protocol::Command& command) {
  if (command.which_action == rheonaut_Command_set_mode_tag) {
    return command.action.set_mode.mode == rheonaut_MODE_MANUAL;
  }
  return command.which_action == rheonaut_Command_set_duty_tag && command.action.set_duty.duty == 0.0F;
}

bool has_timed_setpoint(const RobotEntry& entry) {
  return std::ranges::any_of(entry.orders_ahead(), [](const OrderAhead& order) {
    return order.command->has_execute_at_robot_us && setpoint_of(*order.command);
  });
}

}  // namespace

bool TimedCommands::drop_outdated(RobotEntry& entry, const Client& holder) {
  withdraw_queued(entry, "control_ended", [&holder](const PendingCommand& pending) {
    return pending.record.actor != holder.actor && (pending.is_by_holder || !holder.actor.empty());
  });
  choose_reason(entry, holder);
  const bool is_lost = entry.timed.drop_id != 0 && !entry.commands.unanswered.contains(entry.timed.drop_id);
  if ((entry.timed.drop_because == nullptr && !is_lost) || entry.link == nullptr) return true;
  if (entry.timed.drop_because != nullptr) end_timed(entry, entry.timed.drop_because);
  return send_drop(entry);
}

void TimedCommands::drop_all(RobotEntry& entry, const Client& holder, const char* reason) {
  entry.timed.drop_because = reason;
  drop_outdated(entry, holder);
}

void TimedCommands::choose_reason(RobotEntry& entry, const Client& holder) const {
  TimedOrders& timed = entry.timed;
  const bool is_ahead = entry.robot.latest_robot_time_us <= timed.until_robot_us + kDueGraceUs;
  const bool may_wait = timed.is_of_earlier_run || (!timed.by.actor.empty() && is_ahead);
  if (!may_wait) timed.drop_because = nullptr;
  const bool has_lost_a_step = std::exchange(timed.has_lost_a_step, false);
  if (may_wait && has_lost_a_step && has_timed_setpoint(entry)) timed.drop_because = "step_before_dropped";
  if (may_wait && holder != timed.by) timed.drop_because = "control_ended";
}

CommandId TimedCommands::send_own(RobotEntry& entry, CommandRequest request) {
  request.robot_id = entry.robot.id;
  request.time_to_live = microseconds{protocol::kMaxTimeToLiveUs};
  request.answer_grace = kOwnAnswerGrace;
  const auto own = make_pending(loop_, clock_, request, entry.robot);
  if (!entry.link->send(own->wire, own->deadline_us)) return 0;
  entry.commands.add(own);
  notifier_.publish(own->record);
  return own->record.id;
}

bool TimedCommands::bring_to_rest(RobotEntry& entry) {
  if (entry.link == nullptr) return true;  // a robot without a link comes to rest by itself
  CommandRequest request;
  request.action.which_action = rheonaut_Command_set_mode_tag;
  request.action.action.set_mode.mode = rheonaut_MODE_MANUAL;
  request.arguments = R"({"mode":"manual"})";
  request.actor = "station:limits";
  return send_own(entry, std::move(request)) != 0;
}

bool TimedCommands::send_drop(RobotEntry& entry) {
  CommandRequest request;
  request.action.which_action = rheonaut_Command_drop_timed_tag;
  request.actor = "station:control";
  const CommandId id = send_own(entry, std::move(request));
  if (id == 0) return false;
  entry.timed.by = {};
  entry.timed.until_robot_us = 0;
  entry.timed.is_of_earlier_run = false;
  entry.timed.drop_because = nullptr;
  entry.timed.drop_id = id;
  return true;
}

void TimedCommands::withdraw_queued(RobotEntry& entry, const char* reason,
                                    const std::function<bool(const PendingCommand&)>& is_meant) {
  if (entry.link == nullptr) return;
  std::vector<CommandId> withdrawn;
  for (const auto& [id, pending] : entry.commands.unanswered) {
    const bool is_bound = !pending->is_stop() && needs_control(pending->wire) && !only_ends_motion(pending->wire) &&
                          pending->wire.which_action != rheonaut_Command_drop_timed_tag;
    const bool is_queued = pending->record.state == CommandState::queued;
    if (is_bound && is_queued && is_meant(*pending) && entry.link->withdraw(id)) withdrawn.push_back(id);
  }
  for (const CommandId id : withdrawn) tracker_.finish(entry, id, CommandState::superseded, reason);
}

// What was not sent ends; what was sent ends when the robot reports that it has dropped it.
void TimedCommands::end_timed(RobotEntry& entry, const char* reason) {
  std::vector<CommandId> unsent;
  for (const auto& [id, pending] : entry.commands.unanswered) {
    if (!pending->is_timed_order()) continue;
    pending->dropped_because = reason;
    if (pending->record.state == CommandState::queued && entry.link->withdraw(id)) unsent.push_back(id);
  }
  for (const CommandId id : unsent) tracker_.finish(entry, id, CommandState::superseded, reason);
  for (const auto* sent : {&entry.commands.unseen, &entry.commands.unknown}) {
    for (const auto& pending : *sent) {
      if (pending->is_timed_order()) pending->dropped_because = reason;
    }
  }
}

}  // namespace server::station
