#include "server/station/command_tracker.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/station/commands/effect_proof.hpp"
#include "server/station/commands/read_back.hpp"
#include "server/station/state/unknown_values.hpp"

namespace server::station {
namespace asio = boost::asio;

namespace {

constexpr microseconds kSeenGrace{5'000'000};  // what shows the effect may come so much after it

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

// SAFETY: a clear that took effect before the latest stop says nothing of the latch now.
void note_clear(RobotEntry& entry, const PendingCommand& pending, const protocol::CommandAck& ack) {
  const bool clears = pending.wire.which_action == rheonaut_Command_clear_emergency_tag;
  const bool is_accepted = ack.result == rheonaut_COMMAND_RESULT_ACCEPTED;
  if (!clears || !is_accepted || ack.effect_at_robot_us <= entry.latch_known_at_robot_us) return;
  entry.latch_known_at_robot_us = ack.effect_at_robot_us;
  entry.robot.context.emergency_id = ack.emergency_id;
  if (ack.emergency_id == 0) entry.robot.context.emergency_cause = rheonaut_EMERGENCY_CAUSE_NONE;
}

}  // namespace

Result<std::shared_ptr<PendingCommand>> CommandTracker::find_same(const CommandRequest& request,
                                                                  const RobotEntry& entry) {
  const CommandId id = command_id_of(request.robot_id, request.actor, request.key);
  std::shared_ptr<PendingCommand> same = entry.commands.on_its_way(id);
  if (const auto* recent = recent_.find(id); same == nullptr && recent != nullptr) {
    same = answered_before(loop_, recent->record);
  }
  const bool is_other = same != nullptr && (same->record.kind != protocol::kind(request.action) ||
                                            same->record.arguments != request.arguments);
  if (!is_other) return same;
  return fail(ErrorCode::invalid,
              fmt::format("the key '{}' was used for {} {}; a new command needs a new key", request.key,
                          same->record.kind, same->record.arguments),
              "key_reused");
}

asio::awaitable<Result<CommandRecord>> CommandTracker::follow(std::shared_ptr<PendingCommand> pending,
                                                              bool until_verified, microseconds patience) {
  const CommandRecord& record = pending->record;
  const bool is_on_its_way = record.state == CommandState::queued || record.state == CommandState::sent;
  const bool is_reached = until_verified ? record.ended_at_us != 0 : !is_on_its_way;
  runtime::Signal& reached = until_verified ? pending->ended : pending->answered;
  if (!is_reached) co_await reached.wait_until(clock_, clock_.steady_us() + patience.count());
  co_return record;
}

void CommandTracker::supersede_queued(RobotEntry& entry, const PendingCommand& newer) {
  std::vector<CommandId> older;
  for (const auto& [id, pending] : entry.commands.unanswered) {
    if (is_superseded_by(*pending, newer.wire) && entry.link->withdraw(id)) older.push_back(id);
  }
  for (const CommandId id : older) finish(entry, id, CommandState::superseded, "by_a_newer_command");
}

void CommandTracker::on_sent(RobotEntry& entry, CommandId id) {
  const auto pending = entry.commands.find_unanswered(id);
  if (pending == nullptr || pending->record.state != CommandState::queued) return;
  prepare_proof(entry.robot, entry.commands, *pending, static_cast<std::uint64_t>(robot_now_us(entry.robot, clock_)));
  CommandRecord& record = pending->record;
  record.state = CommandState::sent;
  record.sent_at_us = clock_.utc_us();
  record.sent_after_us = clock_.steady_us() - pending->received_us;
  if (pending->is_timed) stop_times_.sent.add(record.sent_after_us);
  // SAFETY: while stops are being handed to the link nothing is recorded; their sender publishes them afterwards.
  if (entry.commands.sent_with_stop != nullptr) return entry.commands.sent_with_stop->push_back(record);
  notifier_.publish(record);
}

std::shared_ptr<PendingCommand> CommandTracker::find_answered(RobotEntry& entry, const protocol::CommandAck& ack) {
  // One that came too late is sent again; a firmware that does not know the command will not know it then.
  const bool is_late = ack.result == rheonaut_COMMAND_RESULT_EXPIRED;
  if (ack.command_id == entry.timed.drop_id && !is_late) entry.timed.drop_id = 0;
  const bool is_refused = ack.result == rheonaut_COMMAND_RESULT_REJECTED || is_late;
  if (is_refused) entry.orders.drop_schedule(ack.command_id);
  auto pending = entry.commands.find_unanswered(ack.command_id);
  if (pending == nullptr) pending = entry.commands.reopen(ack.command_id);
  if (pending == nullptr) {
    end_dropped(entry, ack);
    return nullptr;
  }
  pending->record.effect_at_robot_us = ack.effect_at_robot_us;
  pending->record.emergency_id = ack.emergency_id;
  return pending;
}

void CommandTracker::on_answer(RobotEntry& entry, PendingCommand& pending, const protocol::CommandAck& ack) {
  note_clear(entry, pending, ack);
  const CommandId id = pending.record.id;
  switch (ack.result) {
    case rheonaut_COMMAND_RESULT_ACCEPTED: return acknowledge(entry, id, "");
    // It was sent before, by a station that was killed before it stored that: the client's key has made it the same
    // command. A robot answers so as well when it had refused it, and says no more unless it gives the time of its
    // effect.
    case rheonaut_COMMAND_RESULT_DUPLICATE:
      if (ack.effect_at_robot_us == 0) return end_without_answer(entry, id, "duplicate");
      return acknowledge(entry, id, "duplicate");
    case rheonaut_COMMAND_RESULT_EXPIRED: return finish(entry, id, CommandState::expired, pending.expiry());
    case rheonaut_COMMAND_RESULT_REJECTED: return finish(entry, id, CommandState::rejected, text_or_number(ack.reason));
    default: return finish(entry, id, CommandState::rejected, text_or_number(ack.result));
  }
}

void CommandTracker::acknowledge(RobotEntry& entry, CommandId id, std::string reason) {
  const auto pending = entry.commands.take_unanswered(id);
  if (pending == nullptr) return;
  CommandRecord& record = pending->record;
  record.acknowledged_after_us = clock_.steady_us() - pending->received_us;
  if (pending->is_timed) stop_times_.acknowledged.add(record.acknowledged_after_us);
  // What was answered before, now again, says no time.
  const bool has_time = record.effect_at_robot_us != 0;
  pending->look_from_robot_us = has_time ? record.effect_at_robot_us : entry.robot.latest_robot_time_us;
  entry.orders.note_accepted(pending, entry.robot.sample_period_us);
  mark_overtaken(entry, *pending);
  // What took effect before this connection may be shown by samples that come after the live ones: their silence says
  // nothing.
  const bool is_of_earlier_connection = pending->look_from_robot_us < entry.connected_at_robot_us;
  // A robot reports nothing anew of what it has answered before.
  const bool can_be_verified = is_read_back(pending->wire) ? has_time : can_be_seen(pending->wire);
  if (!can_be_verified || is_of_earlier_connection) {
    return end(*pending, CommandState::acknowledged, std::move(reason));
  }
  await_effect(entry, pending, std::move(reason));
}

void CommandTracker::mark_overtaken(RobotEntry& entry, PendingCommand& pending) const {
  if (!is_for_the_motor(pending.wire)) return;
  for (const auto& other : entry.commands.unseen) {  // a timed one may come later than one acknowledged after it
    const bool is_older = other->look_from_robot_us <= pending.look_from_robot_us;
    PendingCommand &earlier = is_older ? *other : pending, &later = is_older ? pending : *other;
    earlier.is_overtaken = earlier.is_overtaken || is_excused_by(earlier, later, entry.robot.context.period_us);
  }
}

void CommandTracker::await_effect(RobotEntry& entry, const std::shared_ptr<PendingCommand>& pending,
                                  std::string reason) {
  CommandRecord& record = pending->record;
  const std::int64_t waits_us =
      static_cast<std::int64_t>(pending->look_from_robot_us) - robot_now_us(entry.robot, clock_);
  pending->seen_until_us = std::max(pending->received_us, clock_.steady_us() + waits_us) + kSeenGrace.count();
  record.state = CommandState::acknowledged;
  record.reason = std::move(reason);
  if (pending->has_key) recent_.put(record, clock_.steady_us());
  notifier_.publish(record);
  auto& waiting = is_read_back(pending->wire) ? entry.commands.unread : entry.commands.unseen;
  if (waiting.size() >= RobotCommands::kMaxWaiting) {
    end(*waiting.front(), CommandState::acknowledged, "not_looked_for");
    waiting.pop_front();
  }
  waiting.push_back(pending);
  pending->answered.notify();
}

void CommandTracker::finish(RobotEntry& entry, CommandId id, CommandState state, std::string reason) {
  const auto pending = entry.commands.take_unanswered(id);
  if (pending != nullptr) end(*pending, state, std::move(reason));
}

void CommandTracker::end(PendingCommand& pending, CommandState state, std::string reason) {
  end_command(pending, state, std::move(reason), clock_, recent_);
  notifier_.publish(pending.record);
}

// What the robot has accepted is looked for in each batch until it is seen.
void CommandTracker::on_samples(RobotEntry& entry, const SampleBatch& batch) {
  if (entry.commands.unseen.empty()) return;
  std::erase_if(entry.commands.unseen, [this, &batch](const std::shared_ptr<PendingCommand>& pending) {
    const Sight sight = look_for(pending->wire, pending->look_from_robot_us, pending->record.emergency_id, batch);
    return end_if_sighted(*pending, sight);
  });
}

bool CommandTracker::end_if_sighted(PendingCommand& pending, Sight sight) {
  CommandRecord& record = pending.record;
  switch (sight) {
    case Sight::unseen: return false;
    case Sight::seen:
      record.verified_after_us = clock_.steady_us() - pending.received_us;
      if (pending.is_timed) stop_times_.verified.add(record.verified_after_us);
      end(pending, CommandState::verified, record.reason);
      return true;
    case Sight::overtaken: end(pending, CommandState::superseded, "by_an_emergency"); return true;
    case Sight::missed: break;
  }
  if (pending.is_overtaken) {
    end(pending, CommandState::superseded, "by_a_newer_command");
  } else {
    if (pending.is_stop()) spdlog::error("robot '{}' obeyed an emergency stop, and its motor runs", record.robot_id);
    end(pending, CommandState::failed, "not_seen_in_telemetry");
  }
  return true;
}

// An answer that is still to come does not end by it.
void CommandTracker::on_read_back(RobotEntry& entry, std::span<const std::shared_ptr<PendingCommand>> sent,
                                  std::span<const Sight> sights) {
  for (std::size_t i = 0; i < sent.size(); ++i) {
    PendingCommand& pending = *sent[i];
    CommandRecord& record = pending.record;
    if (sights[i] == Sight::unseen || std::erase(entry.commands.unread, sent[i]) == 0) continue;
    if (sights[i] == Sight::seen) {
      record.verified_after_us = clock_.steady_us() - pending.received_us;
      end(pending, CommandState::verified, record.reason);
    } else if (sights[i] == Sight::overtaken) {
      end(pending, CommandState::superseded, "by_a_newer_command");
    } else {
      spdlog::error("robot '{}' reports other values than those of {} {}", record.robot_id, record.kind,
                    record.arguments);
      end(pending, CommandState::failed, "read_back_differs");
    }
  }
}

// A timed command that was acknowledged when it was taken in, and of which nothing came.
void CommandTracker::end_dropped(RobotEntry& entry, const protocol::CommandAck& ack) {
  auto& unseen = entry.commands.unseen;
  const auto found = std::ranges::find(unseen, ack.command_id, [](const auto& one) { return one->record.id; });
  if (found == unseen.end() || !(*found)->wire.has_execute_at_robot_us) return;
  const bool was_rejected = ack.result == rheonaut_COMMAND_RESULT_REJECTED;
  if (!was_rejected && ack.result != rheonaut_COMMAND_RESULT_EXPIRED) return;
  const auto pending = std::move(*found);
  unseen.erase(found);
  if (pending->dropped_because == nullptr && setpoint_of(pending->wire)) entry.timed.has_lost_a_step = true;
  end(*pending, was_rejected ? CommandState::rejected : CommandState::expired,
      was_rejected ? text_or_number(ack.reason) : pending->expiry());
}

void CommandTracker::end_with_link(RobotEntry& entry, const char* reason) {
  std::vector<CommandId> ended;
  for (const auto& [id, pending] : entry.commands.unanswered) {
    if (!pending->is_stop()) ended.push_back(id);
  }
  for (const CommandId id : ended) end_unanswered(entry, id, reason, CommandState::failed, reason);
  for (auto* waiting : {&entry.commands.unseen, &entry.commands.unread}) {
    for (const auto& pending : std::exchange(*waiting, {})) {
      const bool may_be_dropped = pending->wire.has_execute_at_robot_us;  // which the robot reports when it is back
      end(*pending, may_be_dropped ? CommandState::unknown : CommandState::acknowledged, reason);
      if (may_be_dropped) entry.commands.keep_unknown(pending);
    }
  }
}

void CommandTracker::expire(RobotEntry& entry) {
  if (entry.commands.is_empty()) return;
  const std::int64_t now_us = clock_.steady_us();
  std::vector<CommandId> expired;
  for (const auto& [id, pending] : entry.commands.unanswered) {
    if (pending->is_stop()) continue;
    const bool is_queued = pending->record.state == CommandState::queued;
    if (now_us >= (is_queued ? pending->deadline_us : pending->answer_due_us)) expired.push_back(id);
  }
  for (const CommandId id : expired) {
    end_unanswered(entry, id, "no_answer", CommandState::expired, "not_sent_in_time");
  }
  const auto drop_unseen = [this, now_us](auto& waiting, const char* reason) {
    std::erase_if(waiting, [this, now_us, reason](const std::shared_ptr<PendingCommand>& pending) {
      if (now_us < pending->seen_until_us) return false;
      end(*pending, CommandState::acknowledged, reason);
      return true;
    });
  };
  drop_unseen(entry.commands.unseen, "no_telemetry");
  drop_unseen(entry.commands.unread, "no_read_back");
}

void CommandTracker::end_unanswered(RobotEntry& entry, CommandId id, const char* sent_reason, CommandState queued_state,
                                    const char* queued_reason) {
  const auto pending = entry.commands.find_unanswered(id);
  if (pending == nullptr) return;
  if (pending->record.state == CommandState::sent) return end_without_answer(entry, id, sent_reason);
  finish(entry, id, queued_state, queued_reason);
}

// A command that was sent, when no answer that says what became of it is to be expected any more.
void CommandTracker::end_without_answer(RobotEntry& entry, CommandId id, const char* reason) {
  const auto pending = entry.commands.find_unanswered(id);
  if (pending->seen_after_us >= 0) {
    pending->record.verified_after_us = pending->seen_after_us;
    return finish(entry, id, CommandState::verified, reason);
  }
  finish(entry, id, CommandState::unknown, reason);
  entry.commands.keep_unknown(pending);
}

void CommandTracker::on_event(RobotEntry& entry, const protocol::Event& event) {
  if (event.command_id == 0) return;
  auto pending = entry.commands.find_unanswered(event.command_id);
  if (pending == nullptr) pending = entry.commands.reopen(event.command_id);
  if (pending == nullptr || pending->is_stop() || pending->record.state != CommandState::sent) return;
  pending->record.effect_at_robot_us = event.event_robot_time_us;
  pending->record.emergency_id = event.emergency_id;
  acknowledge(entry, event.command_id, "named_by_event");
}

void CommandTracker::settle_unanswered(RobotEntry& entry, const SampleBatch& batch) {
  if (entry.commands.unanswered.empty() && entry.commands.unknown.empty()) return;
  const std::int64_t now_us = clock_.steady_us();
  for (const auto& [id, pending] : entry.commands.unanswered) {
    const bool is_unanswered = !pending->is_stop() && pending->record.state == CommandState::sent;
    if (is_unanswered && pending->seen_after_us < 0 && is_proved(*pending, batch)) {
      pending->seen_after_us = now_us - pending->received_us;
    }
  }
  std::erase_if(entry.commands.unknown, [this, now_us, &batch](const std::shared_ptr<PendingCommand>& pending) {
    if (!is_proved(*pending, batch)) return false;
    pending->record.verified_after_us = now_us - pending->received_us;
    end(*pending, CommandState::verified, pending->record.reason);
    return true;
  });
}

}  // namespace server::station
