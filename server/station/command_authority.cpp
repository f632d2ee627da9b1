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
  return needs_control(request.action) ? authority_.may_use(request.robot_id, request.actor) : Result<void>{};
}

// SAFETY: by an old picture nobody takes control, and nobody keeps a motor running. Who is in control may still say
// something else to the robot, within the command's time to live.
Result<void> CommandAuthority::check_sight(const CommandRequest& request) const {
  if (!needs_control(request.action) || !is_of_old_picture(request)) return {};
  if (request.action.which_action == rheonaut_Command_renew_lease_tag) return too_old(request.age, "renew a lease");
  if (authority_.of(request.robot_id).holder == request.actor) return {};
  return too_old(request.age, "take control");
}

std::optional<Authority::Change> CommandAuthority::on_commanded(const CommandRequest& request) {
  if (!needs_control(request.action) || is_of_old_picture(request)) return std::nullopt;
  auto change = authority_.use(request.robot_id, request.actor);
  return change ? std::move(*change) : std::nullopt;
}

Result<std::optional<Authority::Change>> CommandAuthority::change(const ControlRequest& request) {
  const RobotId& robot = request.robot_id;
  // SAFETY: nobody takes control by an old picture; nor could they keep it by one.
  if (!is_fresh(request.age)) return too_old(request.age, "take control");
  switch (request.action) {
    case ControlAction::take: return authority_.take(robot, request.actor, request.lease);
    case ControlAction::force: return authority_.take_by_force(robot, request.actor, request.reason);
    case ControlAction::release: return some(authority_.release(robot, request.actor));
    case ControlAction::request: return some(authority_.request(robot, request.actor));
    case ControlAction::hand_over: return some(authority_.hand_over(robot, request.actor));
  }
  return std::nullopt;
}

void CommandAuthority::keep(const std::string& actor, microseconds age) {
  // SAFETY: who looks at an old picture does not keep control.
  if (is_fresh(age)) authority_.keep_alive(actor);
  presence_.note(actor, age);
}

}  // namespace server::station
