// Commands whose answer did not come: their end is unknown until an event or a sample of the robot tells it.
#include <algorithm>
#include <limits>
#include <utility>

#include "server/station/seat.hpp"
#include "server/station/telemetry_verifier.hpp"

namespace server {
namespace {

constexpr std::size_t kMaxUnknown = 64;  // of a robot; the oldest stay unknown

// When it can have taken effect, and samples have shown it, at the latest.
std::uint64_t shown_until_us(const PendingCommand& pending) {
  if (pending.is_stop()) return std::numeric_limits<std::uint64_t>::max();
  return pending.wire.valid_until_robot_us + kVerifyWindowUs;
}

// What a robot comes to without a command, too: by a lease that lapses, a link that is lost, the end of auto.
bool happens_by_itself(const protocol::Command& wire) {
  switch (wire.which_action) {
    case rheonaut_Command_set_mode_tag: return wire.action.set_mode.mode == rheonaut_MODE_MANUAL;
    case rheonaut_Command_set_duty_tag: return wire.action.set_duty.duty == 0.0F;
    case rheonaut_Command_set_duty_schedule_tag: return true;  // its first duty may be that of anything else
    case rheonaut_Command_inject_disturbance_tag: return wire.action.inject_disturbance.disturbance_m == 0.0F;
    default: return false;
  }
}

// Whether the robot's latest sample shows already what the command is to bring about.
bool shows(const RobotState& robot, const protocol::Command& wire) {
  SampleBatch latest;
  latest.context = robot.context;
  if (robot.sample) latest.samples.push_back(*robot.sample);
  return look_for(wire, 0, 0, latest) == Sight::seen;
}

}  // namespace

// Its effect proves that the command has run only if nothing else explains it: neither how the robot was before, nor
// another command for the motor, sent before it or after it; and only while it can have taken effect.
void Station::prepare_proof(Seat& seat, PendingCommand& pending) {
  const auto now_us = static_cast<std::uint64_t>(robot_now_us(*seat.robot));
  pending.look_from_robot_us = now_us;
  if (pending.wire.has_execute_at_robot_us) {
    pending.look_from_robot_us = std::max(now_us, pending.wire.execute_at_robot_us);
  }
  pending.look_until_robot_us = shown_until_us(pending);
  pending.is_proved_by_samples =
      can_be_seen(pending.wire) && !happens_by_itself(pending.wire) && !shows(*seat.robot, pending.wire);
  if (!is_for_the_motor(pending.wire)) return;
  if (!seat.unseen.empty()) pending.is_proved_by_samples = false;
  const auto compare = [&pending, now_us](PendingCommand& other) {
    const bool was_sent = other.record.state != CommandState::queued;
    if (&other == &pending || !was_sent || !is_for_the_motor(other.wire)) return;
    if (shown_until_us(other) > now_us) pending.is_proved_by_samples = false;
    other.look_until_robot_us = std::min(other.look_until_robot_us, now_us);
  };
  for (const auto& [id, other] : seat.commands) compare(*other);
  for (const auto* others : {&seat.unknown, &seat.unseen}) {
    for (const auto& other : *others) compare(*other);
  }
}

// A command that was sent, when no answer is to be expected any more.
void Station::end_without_answer(Seat& seat, CommandId id, const char* reason) {
  const auto pending = seat.commands.at(id);
  if (pending->seen_after_us >= 0) {
    pending->record.verified_after_us = pending->seen_after_us;
    return finish(seat, id, CommandState::verified, reason);
  }
  finish(seat, id, CommandState::unknown, reason);
  seat.keep_unknown(pending);
}

void Seat::keep_unknown(std::shared_ptr<PendingCommand> ended) {
  if (unknown.size() >= kMaxUnknown) unknown.pop_front();
  unknown.push_back(std::move(ended));
}

// One whose end was unknown waits for its end again; null when it is not one of those.
std::shared_ptr<PendingCommand> Station::reopen(Seat& seat, CommandId id) {
  const auto found = std::ranges::find(seat.unknown, id, [](const auto& pending) { return pending->record.id; });
  if (found == seat.unknown.end()) return nullptr;
  const auto pending = *found;
  seat.unknown.erase(found);
  pending->record.state = CommandState::sent;
  pending->record.ended_at_us = 0;
  seat.commands.emplace(id, pending);
  return pending;
}

// A robot sends an acknowledgement before the event of the same command: one that names a command without an answer
// says that the answer is lost, and that the command has run.
void Station::settle_by_event(Seat& seat, const protocol::Event& event) {
  if (event.command_id == 0) return;
  auto entry = seat.commands.find(event.command_id);
  auto pending = entry == seat.commands.end() ? reopen(seat, event.command_id) : entry->second;
  if (pending == nullptr || pending->is_stop() || pending->record.state != CommandState::sent) return;
  pending->record.effect_at_robot_us = event.event_robot_time_us;
  pending->record.emergency_id = event.emergency_id;
  acknowledge(seat, event.command_id, "named_by_event");
}

void Station::settle_by_samples(Seat& seat, const SampleBatch& batch) {
  const std::int64_t now_us = clock_.steady_us();
  const auto is_seen = [&batch](const PendingCommand& pending) {
    return pending.is_proved_by_samples &&
           is_shown_between(pending.wire, pending.look_from_robot_us, pending.look_until_robot_us, batch);
  };
  for (const auto& [id, pending] : seat.commands) {
    const bool is_unanswered = !pending->is_stop() && pending->record.state == CommandState::sent;
    if (is_unanswered && pending->seen_after_us < 0 && is_seen(*pending)) {
      pending->seen_after_us = now_us - pending->received_us;
    }
  }
  std::erase_if(seat.unknown, [this, now_us, &is_seen](const std::shared_ptr<PendingCommand>& pending) {
    if (!is_seen(*pending)) return false;
    pending->record.verified_after_us = now_us - pending->received_us;
    end(*pending, CommandState::verified, pending->record.reason);
    return true;
  });
}

}  // namespace server
