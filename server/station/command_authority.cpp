#include "server/station/command_authority.hpp"

#include <fmt/format.h>

#include <utility>

#include "server/station/commands/command_checks.hpp"

namespace server::station {
namespace {

constexpr microseconds kMs{1000};

bool is_of_old_picture(const CommandRequest& request) {
  const bool is_of_picture = request.life_from == "stamp" || request.unread.count() > 0;
  return is_of_picture && !is_fresh(request.age);
}

// A command that moves the robot, or ends its motion, brings its client into control; one that sets a parameter does
// not.
bool steers(const protocol::Command& command) {
  return moves_the_motor(command) || command.which_action == rheonaut_Command_set_mode_tag;
}

std::unexpected<Error> too_old(microseconds age, const char* what) {
  return fail(ErrorCode::conflict,
              fmt::format("what was seen is {} ms old; at most {} {}", age / kMs, kOldestSight / kMs, what), "stale");
}

Result<std::optional<Authority::Change>> some(Result<Authority::Change> change) {
  if (!change) return std::unexpected{change.error()};
  return std::optional{std::move(*change)};
}

}  // namespace

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

Result<void> CommandAuthority::may_command(const CommandRequest& request) const {
  if (!needs_control(request.action)) return {};
  if (auto may = authority_.may_use(request.robot_id, request.actor); !may) return may;
  // SAFETY: a motor that one tab or program keeps running is kept running by no other one of the same actor.
  const bool is_renewal = request.action.which_action == rheonaut_Command_renew_lease_tag;
  if (!is_renewal || authority_.is_kept_by(request.robot_id, {request.actor, request.client})) return {};
  return fail(ErrorCode::conflict,
              fmt::format("robot '{}' is controlled by another page or program of {}", request.robot_id, request.actor),
              "not_in_control");
}

// SAFETY: by an old picture nobody takes control, and nobody keeps a motor running. Who is in control may still say
// something else to the robot, within the command's time to live.
Result<void> CommandAuthority::check_sight(const CommandRequest& request) const {
  if (!needs_control(request.action) || !is_of_old_picture(request)) return {};
  if (request.action.which_action == rheonaut_Command_renew_lease_tag) return too_old(request.age, "renew a lease");
  if (authority_.of(request.robot_id).holder == request.actor) return {};
  return too_old(request.age, "take control");
}

bool CommandAuthority::changes_client(const CommandRequest& request) const {
  const bool may_take = request.takes_control && steers(request.action) && !is_of_old_picture(request);
  const Client now = authority_.client_of(request.robot_id);
  return may_take && now.actor == request.actor && now.id != request.client;
}

std::optional<Authority::Change> CommandAuthority::on_commanded(const CommandRequest& request) {
  if (!needs_control(request.action) || is_of_old_picture(request)) return std::nullopt;
  auto change = authority_.use(request.robot_id, {request.actor, request.client}, steers(request.action));
  return change ? std::move(*change) : std::nullopt;
}

Result<std::optional<Authority::Change>> CommandAuthority::change(const ControlRequest& request) {
  const RobotId& robot = request.robot_id;
  const Client client{request.actor, request.client};
  // SAFETY: nobody takes control by an old picture; nor could they keep it by one.
  if (!is_fresh(request.age)) return too_old(request.age, "take control");
  switch (request.action) {
    case ControlAction::take: return authority_.take(robot, client, request.lease);
    case ControlAction::force: return authority_.take_by_force(robot, client, request.reason);
    case ControlAction::release: return some(authority_.release(robot, request.actor));
    case ControlAction::request: return some(authority_.request(robot, client));
    case ControlAction::hand_over: return some(authority_.hand_over(robot, request.actor));
  }
  return std::nullopt;
}

void CommandAuthority::keep(const Client& client, const std::optional<RobotId>& robot, microseconds age) {
  // SAFETY: who looks at an old picture does not keep control.
  if (!is_fresh(age)) return;
  robot ? authority_.keep_alive(*robot, client) : authority_.keep_all_alive(client);
}

}  // namespace server::station
