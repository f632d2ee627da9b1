// The station's side of control: one door for what people ask, and what they are told of each change.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string_view>

#include "server/station/seat.hpp"

namespace server {
namespace asio = boost::asio;

namespace {

constexpr microseconds kMs{1000};
constexpr microseconds kWatchInterval{200'000};
constexpr std::size_t kMaxToldBytes = 300;
constexpr std::size_t kMaxNameBytes = 40;
constexpr std::uint64_t kDueGraceUs = 200'000;  // after its time a timed command has run or is dropped

const char* text(ControlAction action) {
  switch (action) {
    case ControlAction::take: return "take";
    case ControlAction::force: return "force";
    case ControlAction::release: return "release";
    case ControlAction::request: return "request";
    case ControlAction::hand_over: return "hand_over";
  }
  return "take";
}

// Nobody loses by it that it still comes, whoever is in control, and someone may by its absence.
bool only_ends_motion(const protocol::Command& command) {
  if (command.which_action == rheonaut_Command_set_mode_tag) {
    return command.action.set_mode.mode == rheonaut_MODE_MANUAL;
  }
  return command.which_action == rheonaut_Command_set_duty_tag && command.action.set_duty.duty == 0.0F;
}

bool has_timed_setpoint(const Seat& seat) {
  return std::ranges::any_of(seat.orders_ahead(), [](const OrderAhead& order) {
    return order.command->has_execute_at_robot_us && setpoint_of(*order.command);
  });
}

bool is_of_old_picture(const CommandRequest& request) {
  const bool is_of_picture = request.life_from == "stamp" || request.unread.count() > 0;
  return is_of_picture && !is_fresh(request.age);
}

std::unexpected<Error> too_old(microseconds age, const char* what) {
  return fail(ErrorCode::conflict,
              fmt::format("what was seen is {} ms old; at most {} {}", age / kMs, kOldestSight / kMs, what), "stale");
}

Result<std::optional<Authority::Change>> some(Result<Authority::Change> change) {
  if (!change) return std::unexpected{change.error()};
  return std::optional{std::move(*change)};
}

Result<std::optional<Authority::Change>> change_control(Authority& authority, const ControlRequest& request) {
  const RobotId& robot = request.robot_id;
  // SAFETY: nobody takes control by an old picture; nor could they keep it by one.
  if (!is_fresh(request.age)) return too_old(request.age, "take control");
  switch (request.action) {
    case ControlAction::take: return authority.take(robot, request.actor, request.life);
    case ControlAction::force: return authority.take_by_force(robot, request.actor, request.reason);
    case ControlAction::release: return some(authority.release(robot, request.actor));
    case ControlAction::request: return some(authority.request(robot, request.actor));
    case ControlAction::hand_over: return some(authority.hand_over(robot, request.actor));
  }
  return std::nullopt;
}

}  // namespace

// SAFETY: nothing that waits on the robot outlives the control of whoever sent it, nor the limits that it was held to.
// Sent before anything that comes next, on a link that keeps the order. False: there is no room for it on the link, so
// no command may follow.
bool Station::drop_timed(Seat& seat) {
  RobotState& robot = *seat.robot;
  const std::string holder = authority_.of(robot.id).holder;
  withdraw_queued(seat, "control_ended", [&holder](const PendingCommand& pending) {
    return pending.record.actor != holder && (pending.is_by_holder || !holder.empty());
  });
  const bool may_wait = !seat.timed_by.empty() && robot.latest_robot_time_us <= seat.timed_until_robot_us + kDueGraceUs;
  if (!may_wait) seat.drop_timed_because = nullptr;
  const bool has_lost_a_step = std::exchange(seat.has_lost_a_step, false);
  if (may_wait && has_lost_a_step && has_timed_setpoint(seat)) seat.drop_timed_because = "step_before_dropped";
  if (may_wait && holder != seat.timed_by) seat.drop_timed_because = "control_ended";
  const bool is_lost = seat.drop_timed_id != 0 && !seat.commands.contains(seat.drop_timed_id);
  if ((seat.drop_timed_because == nullptr && !is_lost) || seat.port == nullptr) return true;
  if (seat.drop_timed_because != nullptr) end_timed(seat, seat.drop_timed_because);
  CommandRequest request;
  request.robot_id = robot.id;
  request.action.which_action = rheonaut_Command_drop_timed_tag;
  request.actor = "station:control";
  request.life = microseconds{protocol::kMaxCommandLifeUs};
  const auto drop = make_pending(request, robot);
  if (!seat.port->send(drop->wire, drop->deadline_us)) return false;
  seat.timed_by.clear();
  seat.timed_until_robot_us = 0;
  seat.drop_timed_because = nullptr;
  seat.drop_timed_id = drop->record.id;
  add_pending(seat, drop);
  publish(drop->record);
  return true;
}

// SAFETY: what still waits for the link is not sent once it may no longer be, timed or not; but it may end a motion.
void Station::withdraw_queued(Seat& seat, const char* reason,
                              const std::function<bool(const PendingCommand&)>& is_meant) {
  if (seat.port == nullptr) return;
  std::vector<CommandId> withdrawn;
  for (const auto& [id, pending] : seat.commands) {
    const bool is_bound = !pending->is_stop() && needs_control(pending->wire) && !only_ends_motion(pending->wire) &&
                          pending->wire.which_action != rheonaut_Command_drop_timed_tag;
    const bool is_queued = pending->record.state == CommandState::queued;
    if (is_bound && is_queued && is_meant(*pending) && seat.port->withdraw(id)) withdrawn.push_back(id);
  }
  for (const CommandId id : withdrawn) finish(seat, id, CommandState::superseded, reason);
}

// What was not sent ends; what was sent ends when the robot says that it has dropped it.
void Station::end_timed(Seat& seat, const char* reason) {
  std::vector<CommandId> unsent;
  for (const auto& [id, pending] : seat.commands) {
    if (!pending->wire.has_execute_at_robot_us) continue;
    pending->dropped_because = reason;
    if (pending->record.state == CommandState::queued && seat.port->withdraw(id)) unsent.push_back(id);
  }
  for (const CommandId id : unsent) finish(seat, id, CommandState::superseded, reason);
  for (const auto* sent : {&seat.unseen, &seat.unknown}) {
    for (const auto& pending : *sent) {
      if (pending->wire.has_execute_at_robot_us) pending->dropped_because = reason;
    }
  }
}

Result<ControlState> Station::control(const ControlRequest& request) {
  if (const auto seat = seats_.find(request.robot_id); seat != seats_.end()) drop_timed(seat->second);
  Result<std::optional<Authority::Change>> change =
      fail(ErrorCode::not_found, fmt::format("no robot '{}' is known", request.robot_id), "unknown_robot");
  if (robots_.contains(request.robot_id)) change = change_control(authority_, request);
  if (!change) {
    note_refusal({request.actor, request.peer, clock_.utc_us()}, request.robot_id, "control",
                 fmt::format(R"({{"wish":"{}"}})", text(request.action)), change.error());
    return std::unexpected{change.error()};
  }
  if (*change) tell(**change, request.actor, request.peer);
  return authority_.of(request.robot_id);
}

Result<void> Station::may_control(const CommandRequest& request) const {
  return needs_control(request.action) ? authority_.may_use(request.robot_id, request.actor) : Result<void>{};
}

// SAFETY: by an old picture nobody takes control, and nobody keeps a motor running. Who is in control may still say
// something else to the robot, within the command's life.
Result<void> Station::check_sight(const CommandRequest& request) const {
  if (!needs_control(request.action) || !is_of_old_picture(request)) return {};
  if (request.action.which_action == rheonaut_Command_renew_lease_tag) return too_old(request.age, "renew a lease");
  if (authority_.of(request.robot_id).holder == request.actor) return {};
  return too_old(request.age, "take control");
}

// Nobody has it: who commands takes it.
void Station::use_control(const CommandRequest& request) {
  if (!needs_control(request.action) || is_of_old_picture(request)) return;
  if (const auto change = authority_.use(request.robot_id, request.actor); change && *change) {
    tell(**change, request.actor, request.peer);
  }
}

void Station::keep_control(const std::string& actor, microseconds age) {
  // SAFETY: who looks at an old picture does not keep control.
  if (is_fresh(age)) authority_.keep_alive(actor);
}

asio::awaitable<void> Station::watch_control() {
  for (;;) {
    co_await clock_.sleep_for(kWatchInterval);
    for (const Authority::Change& change : authority_.expire()) tell(change, "station", "");
  }
}

// Of what somebody else says only the beginning: it may be anything.
void Station::note_refusal(Author by, const RobotId& robot_id, const char* what, std::string detail,
                           const Error& error) {
  nlohmann::json told = nlohmann::json::parse(detail, nullptr, false);
  if (!told.is_object()) told = nlohmann::json::object();
  told["problem"] = error.detail.substr(0, kMaxToldBytes);
  if (!error.reason.empty()) told["reason"] = error.reason;
  AuditNote note;
  note.by = std::move(by);
  note.robot_id = robots_.contains(robot_id) ? robot_id : "";
  note.action = std::string{what} + ".refused";
  note.subject = robot_id.substr(0, kMaxNameBytes);
  note.detail = audit_detail(told);
  note.can_flood = true;
  for (StationSink* sink : sinks_) sink->on_audit(note);
}

void Station::tell(const Authority::Change& change, const std::string& actor, const std::string& peer) {
  const auto robot = robots_.find(change.robot_id);
  if (robot == robots_.end()) return;
  robot->second.control = authority_.of(change.robot_id);
  drop_timed(seats_.at(change.robot_id));
  note(robot->second, change.kind, change.cause);
  AuditNote audit;
  audit.by = {actor, peer, clock_.utc_us()};
  audit.robot_id = change.robot_id;
  audit.action = "control." + change.kind.substr(std::string_view{"control_"}.size());
  audit.detail = audit_detail({{"cause", change.cause}, {"holder", robot->second.control.holder}});
  for (StationSink* sink : sinks_) sink->on_audit(audit);
  publish(robot->second);
}

}  // namespace server
