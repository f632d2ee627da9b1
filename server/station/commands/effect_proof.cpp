#include "server/station/commands/effect_proof.hpp"

#include <algorithm>
#include <limits>

#include "server/station/commands/telemetry_verifier.hpp"

namespace server::station {
namespace {

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

void prepare_proof(const RobotState& robot, const RobotCommands& commands, PendingCommand& pending,
                   std::uint64_t now_us) {
  pending.look_from_robot_us = now_us;
  if (pending.wire.has_execute_at_robot_us) {
    pending.look_from_robot_us = std::max(now_us, pending.wire.execute_at_robot_us);
  }
  pending.look_until_robot_us = shown_until_us(pending);
  pending.is_proved_by_samples =
      can_be_seen(pending.wire) && !happens_by_itself(pending.wire) && !shows(robot, pending.wire);
  if (!is_for_the_motor(pending.wire)) return;
  if (!commands.unseen.empty()) pending.is_proved_by_samples = false;
  const auto compare = [&pending, now_us](PendingCommand& other) {
    const bool was_sent = other.record.state != CommandState::queued;
    if (&other == &pending || !was_sent || !is_for_the_motor(other.wire)) return;
    if (shown_until_us(other) > now_us) pending.is_proved_by_samples = false;
    other.look_until_robot_us = std::min(other.look_until_robot_us, now_us);
  };
  for (const auto& [id, other] : commands.unanswered) compare(*other);
  for (const auto* others : {&commands.unknown, &commands.unseen}) {
    for (const auto& other : *others) compare(*other);
  }
}

bool is_proved(const PendingCommand& pending, const SampleBatch& batch) {
  return pending.is_proved_by_samples &&
         is_shown_between(pending.wire, pending.look_from_robot_us, pending.look_until_robot_us, batch);
}

}  // namespace server::station
