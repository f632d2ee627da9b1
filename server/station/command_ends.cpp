// How commands end: answered by the robot, seen in telemetry, expired, overtaken.
#include <spdlog/spdlog.h>

#include <utility>

#include "server/station/seat.hpp"
#include "server/station/telemetry_verifier.hpp"
#include "server/station/unknown_values.hpp"

namespace server {
namespace {

constexpr microseconds kAckGrace{1'000'000};   // an answer may come this much after the life ended
constexpr microseconds kSeenGrace{5'000'000};  // telemetry may come so much after the answer
constexpr std::size_t kMaxUnseen = 64;

}  // namespace

void Station::on_command_sent(RobotPort& port, CommandId id) {
  Seat* seat = seat_of(port);
  if (seat == nullptr) return;
  const auto pending = seat->commands.find(id);
  if (pending == seat->commands.end() || pending->second->record.state != CommandState::queued) return;
  prepare_proof(*seat, *pending->second);
  pending->second->record.state = CommandState::sent;
  CommandRecord& record = pending->second->record;
  record.sent_at_us = clock_.utc_us();
  record.sent_after_us = clock_.steady_us() - pending->second->received_us;
  if (pending->second->is_timed) stop_times_.sent.add(record.sent_after_us);
  publish(record);
}

void Station::on_command_ack(RobotPort& port, const protocol::CommandAck& ack) {
  Seat* seat = seat_of(port);
  if (seat == nullptr) return;
  const auto entry = seat->commands.find(ack.command_id);
  const auto pending = entry == seat->commands.end() ? reopen(*seat, ack.command_id) : entry->second;
  if (pending == nullptr) return;  // ended already
  CommandRecord& record = pending->record;
  record.effect_at_robot_us = ack.effect_at_robot_us;
  record.emergency_id = ack.emergency_id;
  const bool clears = pending->wire.which_action == rheonaut_Command_clear_emergency_tag;
  if (pending->is_stop()) return settle_stops(*seat, *pending, ack);
  const bool accepted = ack.result == rheonaut_COMMAND_RESULT_ACCEPTED;
  // SAFETY: a clear that took effect before the latest stop says nothing of the latch now.
  if (clears && accepted && ack.effect_at_robot_us > seat->latch_known_at_robot_us) {
    seat->latch_known_at_robot_us = ack.effect_at_robot_us;
    seat->robot->context.emergency_id = ack.emergency_id;
    if (ack.emergency_id == 0) seat->robot->context.emergency_cause = rheonaut_EMERGENCY_CAUSE_NONE;
  }
  switch (ack.result) {
    case rheonaut_COMMAND_RESULT_ACCEPTED: acknowledge(*seat, record.id, ""); break;
    // It was sent before, by a station that has restarted since: the client's key has made it the same command.
    case rheonaut_COMMAND_RESULT_DUPLICATE: acknowledge(*seat, record.id, "duplicate"); break;
    case rheonaut_COMMAND_RESULT_EXPIRED: finish(*seat, record.id, CommandState::expired, "expired"); break;
    case rheonaut_COMMAND_RESULT_REJECTED:
      finish(*seat, record.id, CommandState::rejected, text_or_number(ack.reason));
      break;
    default: finish(*seat, record.id, CommandState::rejected, text_or_number(ack.result)); break;
  }
  publish(*seat->robot);
}

void Station::acknowledge(Seat& seat, CommandId id, std::string reason) {
  const auto entry = seat.commands.find(id);
  if (entry == seat.commands.end()) return;
  const auto pending = entry->second;
  seat.commands.erase(entry);
  CommandRecord& record = pending->record;
  record.acknowledged_after_us = clock_.steady_us() - pending->received_us;
  if (pending->is_timed) stop_times_.acknowledged.add(record.acknowledged_after_us);
  if (is_for_the_motor(pending->wire)) {
    for (const auto& older : seat.unseen) older->is_overtaken = older->is_overtaken || is_for_the_motor(older->wire);
  }
  // What was answered before, now again, says no time.
  const bool has_time = record.effect_at_robot_us != 0;
  pending->look_from_robot_us = has_time ? record.effect_at_robot_us : seat.robot->latest_robot_time_us;
  // What took effect before this connection may be shown by samples that come after the live ones: their silence says
  // nothing.
  const bool is_of_earlier_connection = pending->look_from_robot_us < seat.connected_at_robot_us;
  if (!can_be_seen(pending->wire) || is_of_earlier_connection) {
    return end(*pending, CommandState::acknowledged, std::move(reason));
  }
  record.state = CommandState::acknowledged;
  record.reason = std::move(reason);
  if (pending->has_key) recent_.put(record, clock_.steady_us());
  publish(record);
  if (seat.unseen.size() >= kMaxUnseen) {
    end(*seat.unseen.front(), CommandState::acknowledged, "not_looked_for");
    seat.unseen.pop_front();
  }
  seat.unseen.push_back(pending);
  pending->answered.notify();
}

void Station::finish(Seat& seat, CommandId id, CommandState state, std::string reason) {
  const auto entry = seat.commands.find(id);
  if (entry == seat.commands.end()) return;
  const auto pending = entry->second;
  seat.commands.erase(entry);
  end(*pending, state, std::move(reason));
}

void Station::end(PendingCommand& pending, CommandState state, std::string reason) {
  CommandRecord& record = pending.record;
  record.state = state;
  record.reason = std::move(reason);
  record.ended_at_us = clock_.utc_us();
  if (pending.has_key) recent_.put(record, clock_.steady_us());
  publish(record);
  pending.answered.notify();
  pending.ended.notify();
}

// What the robot has accepted is looked for in each batch until it is seen.
void Station::look_for_commands(Seat& seat, const SampleBatch& batch) {
  std::erase_if(seat.unseen, [this, &batch](const std::shared_ptr<PendingCommand>& pending) {
    CommandRecord& record = pending->record;
    switch (look_for(pending->wire, pending->look_from_robot_us, record.emergency_id, batch)) {
      case Sight::unseen: return false;
      case Sight::seen:
        record.verified_after_us = clock_.steady_us() - pending->received_us;
        if (pending->is_timed) stop_times_.verified.add(record.verified_after_us);
        end(*pending, CommandState::verified, record.reason);
        return true;
      case Sight::overtaken: end(*pending, CommandState::superseded, "by_an_emergency"); return true;
      case Sight::missed: break;
    }
    if (pending->is_overtaken) {
      end(*pending, CommandState::superseded, "by_a_newer_command");
    } else {
      if (pending->is_stop()) spdlog::error("robot '{}' obeyed an emergency stop, and its motor runs", record.robot_id);
      end(*pending, CommandState::failed, "not_seen_in_telemetry");
    }
    return true;
  });
}

void Station::end_unseen(Seat& seat, const char* reason) {
  for (const auto& pending : std::exchange(seat.unseen, {})) end(*pending, CommandState::acknowledged, reason);
}

void Station::expire_commands(Seat& seat) {
  if (seat.commands.empty() && seat.unseen.empty()) return;
  const std::int64_t now_us = clock_.steady_us();
  std::vector<CommandId> expired;
  for (const auto& [id, pending] : seat.commands) {
    if (pending->is_stop()) continue;
    const std::int64_t grace_us = pending->record.state == CommandState::queued ? 0 : kAckGrace.count();
    if (now_us >= pending->deadline_us + grace_us) expired.push_back(id);
  }
  for (const CommandId id : expired) {
    const bool was_sent = seat.commands.at(id)->record.state == CommandState::sent;
    was_sent ? end_without_answer(seat, id, "no_answer") : finish(seat, id, CommandState::expired, "not_sent_in_time");
  }
  while (!seat.unseen.empty() && now_us - seat.unseen.front()->received_us >= kSeenGrace.count()) {
    end(*seat.unseen.front(), CommandState::acknowledged, "no_telemetry");
    seat.unseen.pop_front();
  }
}

}  // namespace server
