// The station's side of control: one door for what people ask, and what they are told of each change.
#include <fmt/format.h>

#include "server/station/seat.hpp"

namespace server {
namespace asio = boost::asio;

namespace {

constexpr microseconds kWatchInterval{200'000};
constexpr microseconds kOldestSight{400'000};  // of what a page has seen, to keep control

Result<std::optional<Authority::Change>> some(Result<Authority::Change> change) {
  if (!change) return std::unexpected{change.error()};
  return std::optional{std::move(*change)};
}

Result<std::optional<Authority::Change>> change_control(Authority& authority, const ControlRequest& request) {
  const RobotId& robot = request.robot_id;
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

Result<ControlState> Station::control(const ControlRequest& request) {
  if (!robots_.contains(request.robot_id)) {
    return fail(ErrorCode::not_found, fmt::format("no robot '{}' is known", request.robot_id), "unknown_robot");
  }
  const auto change = change_control(authority_, request);
  if (!change) return std::unexpected{change.error()};
  if (*change) tell(**change);
  return authority_.of(request.robot_id);
}

// Nobody has it: who commands takes it.
Result<void> Station::use_control(const CommandRequest& request) {
  if (!needs_control(request.action)) return {};
  const auto change = authority_.use(request.robot_id, request.actor);
  if (!change) return std::unexpected{change.error()};
  if (*change) tell(**change);
  return {};
}

void Station::keep_control(const std::string& actor, microseconds age) {
  // SAFETY: who looks at an old picture does not keep control.
  if (age >= microseconds{0} && age <= kOldestSight) authority_.keep_alive(actor);
}

asio::awaitable<void> Station::watch_control() {
  for (;;) {
    co_await clock_.sleep_for(kWatchInterval);
    for (const Authority::Change& change : authority_.expire()) tell(change);
  }
}

void Station::tell(const Authority::Change& change) {
  const auto robot = robots_.find(change.robot_id);
  if (robot == robots_.end()) return;
  robot->second.control = authority_.of(change.robot_id);
  note(robot->second, change.kind, change.cause);
  publish(robot->second);
}

}  // namespace server
