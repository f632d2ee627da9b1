// How commands end: answered by the robot, seen in telemetry, expired, overtaken.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/station/read_back.hpp"
#include "server/station/seat.hpp"
#include "server/station/state/unknown_values.hpp"
#include "server/station/telemetry_verifier.hpp"

namespace server {
namespace {

constexpr microseconds kAckGrace{1'000'000};   // an answer may come this much after the life ended
constexpr microseconds kSeenGrace{5'000'000};  // what shows the effect may come so much after it
constexpr std::size_t kMaxUnseen = 64;

// Whether a command need not be seen in telemetry since a later one has taken its place.
bool is_excused_by(const PendingCommand& earlier, const PendingCommand& later, std::uint32_t period_us) {
  // SAFETY: a robot that was stopped moves only after a clear, so nothing else excuses a stop; not even a command that
  // was acknowledged for a time after it, which the stop has dropped.
  const bool ends_a_stop = later.is_stop() || later.wire.which_action == rheonaut_Command_clear_emergency_tag;
  if (earlier.is_stop() && !ends_a_stop) return false;
  // SAFETY: nothing excuses what should have been seen before it acts.
  const std::uint64_t visible_us = visible_from_us(earlier.wire, earlier.look_from_robot_us, period_us);
  return is_for_the_motor(earlier.wire) && later.look_from_robot_us <= visible_us + kVerifyWindowUs;
}

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
  // One that came too late is sent again; a firmware that does not know the command will not know it then.
  const bool is_late = ack.result == rheonaut_COMMAND_RESULT_EXPIRED;
  if (ack.command_id == seat->drop_timed_id && !is_late) seat->drop_timed_id = 0;
  const bool is_refused = ack.result == rheonaut_COMMAND_RESULT_REJECTED || is_late;
  if (is_refused) seat->drop_schedule(ack.command_id);
  const auto entry = seat->commands.find(ack.command_id);
  const auto pending = entry == seat->commands.end() ? reopen(*seat, ack.command_id) : entry->second;
  if (pending == nullptr) return end_dropped(*seat, ack);
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
    case rheonaut_COMMAND_RESULT_EXPIRED: finish(*seat, record.id, CommandState::expired, pending->expiry()); break;
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
  // What was answered before, now again, says no time.
  const bool has_time = record.effect_at_robot_us != 0;
  pending->look_from_robot_us = has_time ? record.effect_at_robot_us : seat.robot->latest_robot_time_us;
  seat.note_accepted(pending);
  if (is_for_the_motor(pending->wire)) {
    for (const auto& other : seat.unseen) {  // a timed one may come later than one that was acknowledged after it
      const bool is_older = other->look_from_robot_us <= pending->look_from_robot_us;
      PendingCommand &earlier = is_older ? *other : *pending, &later = is_older ? *pending : *other;
      earlier.is_overtaken = earlier.is_overtaken || is_excused_by(earlier, later, seat.robot->context.period_us);
    }
  }
  // What took effect before this connection may be shown by samples that come after the live ones: their silence says
  // nothing.
  const bool is_of_earlier_connection = pending->look_from_robot_us < seat.connected_at_robot_us;
  const bool has_to_be_read = is_read_back(pending->wire);
  // A robot reports nothing anew of what it has answered before.
  const bool can_be_verified = has_to_be_read ? has_time : can_be_seen(pending->wire);
  if (!can_be_verified || is_of_earlier_connection) {
    return end(*pending, CommandState::acknowledged, std::move(reason));
  }
  const std::int64_t waits_us = static_cast<std::int64_t>(pending->look_from_robot_us) - robot_now_us(*seat.robot);
  pending->seen_until_us = std::max(pending->received_us, clock_.steady_us() + waits_us) + kSeenGrace.count();
  record.state = CommandState::acknowledged;
  record.reason = std::move(reason);
  if (pending->has_key) recent_.put(record, clock_.steady_us());
  publish(record);
  auto& waiting = has_to_be_read ? seat.unread : seat.unseen;
  if (waiting.size() >= kMaxUnseen) {
    end(*waiting.front(), CommandState::acknowledged, "not_looked_for");
    waiting.pop_front();
  }
  waiting.push_back(pending);
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

std::vector<std::shared_ptr<PendingCommand>> Seat::to_be_read_back() const {
  std::vector<std::shared_ptr<PendingCommand>> sent{unread.begin(), unread.end()};
  for (const auto& [id, pending] : commands) {
    if (pending->record.state == CommandState::sent && is_read_back(pending->wire)) sent.push_back(pending);
  }
  std::ranges::sort(sent, {}, &PendingCommand::number);
  return sent;
}

// What the robot says is in force ends the commands that have waited for it; an answer that is still to come does not.
void Station::settle_read_back(Seat& seat, const std::vector<std::shared_ptr<PendingCommand>>& sent,
                               const std::vector<Sight>& sights) {
  for (std::size_t i = 0; i < sent.size(); ++i) {
    PendingCommand& pending = *sent[i];
    CommandRecord& record = pending.record;
    if (sights[i] == Sight::unseen || std::erase(seat.unread, sent[i]) == 0) continue;
    if (sights[i] == Sight::seen) {
      record.verified_after_us = clock_.steady_us() - pending.received_us;
      end(pending, CommandState::verified, record.reason);
    } else if (sights[i] == Sight::overtaken) {
      end(pending, CommandState::superseded, "by_a_newer_command");
    } else {
      spdlog::error("robot '{}' says after {} {} what it was not told", record.robot_id, record.kind, record.arguments);
      end(pending, CommandState::failed, "read_back_differs");
    }
  }
}

// A timed command that was acknowledged when it was taken in, and of which nothing came.
void Station::end_dropped(Seat& seat, const protocol::CommandAck& ack) {
  const auto found = std::ranges::find(seat.unseen, ack.command_id, [](const auto& one) { return one->record.id; });
  if (found == seat.unseen.end() || !(*found)->wire.has_execute_at_robot_us) return;
  const bool was_rejected = ack.result == rheonaut_COMMAND_RESULT_REJECTED;
  if (!was_rejected && ack.result != rheonaut_COMMAND_RESULT_EXPIRED) return;
  const auto pending = *found;
  seat.unseen.erase(found);
  if (pending->dropped_because == nullptr && setpoint_of(pending->wire)) seat.has_lost_a_step = true;
  end(*pending, was_rejected ? CommandState::rejected : CommandState::expired,
      was_rejected ? text_or_number(ack.reason) : pending->expiry());
}

void Station::end_unseen(Seat& seat, const char* reason) {
  for (auto* waiting : {&seat.unseen, &seat.unread}) {
    for (const auto& pending : std::exchange(*waiting, {})) {
      const bool may_be_dropped = pending->wire.has_execute_at_robot_us;  // of which the robot tells when it is back
      end(*pending, may_be_dropped ? CommandState::unknown : CommandState::acknowledged, reason);
      if (may_be_dropped) seat.keep_unknown(pending);
    }
  }
}

void Station::expire_commands(Seat& seat) {
  if (seat.commands.empty() && seat.unseen.empty() && seat.unread.empty()) return;
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
  const auto give_up = [this, now_us](auto& waiting, const char* reason) {
    std::erase_if(waiting, [this, now_us, reason](const std::shared_ptr<PendingCommand>& pending) {
      if (now_us < pending->seen_until_us) return false;
      end(*pending, CommandState::acknowledged, reason);
      return true;
    });
  };
  give_up(seat.unseen, "no_telemetry");
  give_up(seat.unread, "no_read_back");
}

}  // namespace server
