#include "server/station/command_dispatch.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "server/station/commands/command_checks.hpp"
#include "server/station/station_parts.hpp"

namespace server::station {
namespace {

constexpr microseconds kMaxTimeToLive{protocol::kMaxTimeToLiveUs};

// A robot refuses what would come after the command's time to live.
Result<void> check_time(const PendingCommand& pending, const RobotState& robot) {
  const protocol::Command& wire = pending.wire;
  if (!wire.has_execute_at_robot_us || wire.execute_at_robot_us <= wire.valid_until_robot_us) return {};
  return fail(
      ErrorCode::invalid,
      fmt::format("execute_at_robot_us = {} lies {} ms after the end of the command's life, which is counted in "
                  "the time of robot '{}', now at least {}; life_ms must reach it",
                  wire.execute_at_robot_us, (wire.execute_at_robot_us - wire.valid_until_robot_us) / 1000 + 1, robot.id,
                  robot.latest_robot_time_us),
      "out_of_range");
}

// What speaks against the request; nothing is sent then.
Result<void> check_request(const CommandRequest& request, const protocol::Command& wire, const RobotEntry& entry,
                           const config::Envelope& envelope) {
  if (request.time_to_live <= microseconds{0} || request.time_to_live > kMaxTimeToLive) {
    return fail(ErrorCode::invalid,
                fmt::format("life_ms = {} is outside 1 to 10000", request.time_to_live.count() / 1000), "out_of_range");
  }
  if (entry.link == nullptr) {
    return fail(ErrorCode::not_connected, fmt::format("robot '{}' is not connected", request.robot_id),
                "not_connected");
  }
  // SAFETY: which setpoint is in force, or where the robot has come to, no hello says.
  const bool is_shown = entry.orders.next_sample_at_robot_us() != entry.connected_at_robot_us;
  const bool is_compared = entry.robot.context.mode == rheonaut_MODE_AUTO || entry.robot.sample;
  if (setpoint_of(wire) && is_compared && !is_shown) {
    return fail(ErrorCode::invalid,
                fmt::format("robot '{}' has just connected, and what a step counts from is not known before its next "
                            "telemetry",
                            request.robot_id),
                "step_too_large");
  }
  return check_command(wire, entry.robot, envelope, entry.orders_ahead(&wire));
}

void note_timed(TimedOrders& timed, const Client& holder, const CommandRequest& request,
                const PendingCommand& pending) {
  if (!pending.is_timed_order()) return;
  timed.by = holder.actor == request.actor ? holder : Client{request.actor, request.client};
  timed.until_robot_us = std::max(timed.until_robot_us, pending.wire.execute_at_robot_us);
}

// SAFETY: what was refused, also by a full queue, or came too late, takes no control.
void take_control(StationParts& parts, const CommandRequest& request, PendingCommand& sent) {
  if (!request.takes_control) return;
  if (const auto change = parts.control.on_commanded(request)) parts.publish(*change, request.actor, request.peer);
  sent.is_by_holder = parts.control.of(request.robot_id).holder == request.actor;
}

}  // namespace

Result<std::shared_ptr<PendingCommand>> dispatch(StationParts& parts, RobotEntry& entry,
                                                 const CommandRequest& request) {
  // SAFETY: only the holder of control moves the robot, be it a page, a script or an experiment.
  if (auto held = parts.control.may_command(request); !held) return std::unexpected{held.error()};
  // SAFETY: timed commands of the former holder of control are dropped from the robot before this command is sent, or
  // it is not sent.
  bool is_clear = !needs_control(request.action) || parts.drop_outdated(entry);
  auto pending = make_pending(parts.loop, parts.clock, request, entry.robot);
  const auto checked = check_request(request, pending->wire, entry, parts.envelope);
  if (!checked) return std::unexpected{checked.error()};
  // SAFETY: what was issued longer ago than its time to live is not sent, and is accounted for.
  if (request.age >= request.time_to_live) {
    parts.tracker.end(*pending, CommandState::expired, "too_old_on_arrival");
    return pending;
  }
  if (auto seen = parts.control.check_sight(request); !seen) return std::unexpected{seen.error()};
  if (auto reached = check_time(*pending, entry.robot); !reached) return std::unexpected{reached.error()};
  // SAFETY: so are those of another page or program of the same actor, into whose place this command comes.
  const Client client{request.actor, request.client};
  if (is_clear && parts.control.changes_client(request)) is_clear = parts.timed.drop_outdated(entry, client);
  if (is_clear) parts.tracker.supersede_queued(entry, *pending);
  if (!is_clear || !entry.link->send(pending->wire, pending->deadline_us)) {
    return fail(ErrorCode::unavailable, fmt::format("too many commands wait for robot '{}'", request.robot_id),
                "queue_full");
  }
  take_control(parts, request, *pending);
  note_timed(entry.timed, parts.control.client_of(request.robot_id), request, *pending);
  entry.commands.add(pending);
  parts.notifier.publish(pending->record);
  return pending;
}

}  // namespace server::station
