#include "server/station/commands/pending_command.hpp"

#include <sodium.h>

#include <algorithm>
#include <utility>

namespace server::station {
namespace {

CommandId random_id() {
  CommandId id = 0;
  while (id == 0) randombytes_buf(&id, sizeof id);
  return id;
}

}  // namespace

std::int64_t robot_now_us(const RobotState& robot, const runtime::Clock& clock) {
  return static_cast<std::int64_t>(robot.latest_robot_time_us) + clock.steady_us() - robot.last_received_steady_us;
}

std::shared_ptr<PendingCommand> make_pending(boost::asio::io_context& loop, const runtime::Clock& clock,
                                             const CommandRequest& request, const RobotState& robot) {
  auto pending = std::make_shared<PendingCommand>(loop);
  const std::int64_t now_us = clock.steady_us();
  pending->received_us = request.received_us == 0 ? now_us : request.received_us;
  pending->has_key = !request.key.empty();
  pending->wire = request.action;
  pending->wire.command_id =
      pending->has_key ? command_id_of(request.robot_id, request.actor, request.key) : random_id();
  pending->wire.boot_id = robot.boot_id;
  CommandRecord& record = pending->record;
  record.id = pending->wire.command_id;
  record.robot_id = robot.id;
  record.boot_id = robot.boot_id;
  record.kind = protocol::kind(request.action);
  record.arguments = request.arguments;
  record.actor = request.actor;
  record.peer = request.peer;
  record.submitted_at_us = clock.utc_us();
  if (!pending->is_stop()) {
    // The robot's clock is not known exactly; this reading is never ahead of it, so the command can only expire
    // earlier.
    const std::int64_t left_us = std::max<std::int64_t>((request.time_to_live - request.age).count(), 0);
    pending->wire.valid_until_robot_us = static_cast<std::uint64_t>(robot_now_us(robot, clock) + left_us);
    pending->deadline_us = now_us + left_us;
    pending->answer_due_us = pending->deadline_us + request.answer_grace.count();
    record.life_from = request.life_from;
  }
  return pending;
}

std::shared_ptr<PendingCommand> answered_before(boost::asio::io_context& loop, const CommandRecord& record) {
  auto same = std::make_shared<PendingCommand>(loop);
  same->record = record;
  return same;
}

void end_command(PendingCommand& pending, CommandState state, std::string reason, const runtime::Clock& clock,
                 RecentCommands& recent) {
  CommandRecord& record = pending.record;
  record.state = state;
  record.reason = std::move(reason);
  record.ended_at_us = clock.utc_us();
  if (pending.has_key) recent.put(record, clock.steady_us());
  pending.answered.notify();
  pending.ended.notify();
}

bool is_superseded_by(const PendingCommand& older, const protocol::Command& newer) {
  const auto kind = newer.which_action;
  if (kind != rheonaut_Command_set_setpoint_tag && kind != rheonaut_Command_set_duty_tag) return false;
  if (newer.has_execute_at_robot_us || older.wire.has_execute_at_robot_us) return false;  // each at its time
  // SAFETY: a duty of 0 also cancels the timed commands that wait in the robot, which a later duty would not.
  const auto is_halt = [](const protocol::Command& command) { return command.action.set_duty.duty == 0; };
  if (kind == rheonaut_Command_set_duty_tag && is_halt(older.wire) && !is_halt(newer)) return false;
  return older.record.state == CommandState::queued && older.wire.which_action == kind;
}

}  // namespace server::station
