// The one door for commands: checks a wish, gives it an id and a life, and hands it to the link.
#include <sodium.h>

#include <fmt/format.h>
#include <algorithm>

#include "server/station/seat.hpp"

namespace server {
namespace asio = boost::asio;

namespace {

constexpr microseconds kMaxLife{protocol::kMaxCommandLifeUs};
constexpr microseconds kPatience{2'000'000};  // with the answer, after the life has ended
constexpr microseconds kSeenPatience{6'000'000};

CommandId random_id() {
  CommandId id = 0;
  while (id == 0) randombytes_buf(&id, sizeof id);
  return id;
}

// A robot refuses what would come after the command's life.
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

}  // namespace

const char* text(CommandState value) {
  switch (value) {
    case CommandState::queued: return "queued";
    case CommandState::sent: return "sent";
    case CommandState::acknowledged: return "acknowledged";
    case CommandState::verified: return "verified";
    case CommandState::rejected: return "rejected";
    case CommandState::expired: return "expired";
    case CommandState::failed: return "failed";
    case CommandState::superseded: return "superseded";
    case CommandState::unknown: break;
  }
  return "unknown";
}

std::shared_ptr<PendingCommand> Station::make_pending(const CommandRequest& request, const RobotState& robot) {
  auto pending = std::make_shared<PendingCommand>(loop_);
  const std::int64_t now_us = clock_.steady_us();
  pending->received_us = request.received_us == 0 ? now_us : request.received_us;
  pending->has_key = !request.key.empty();
  pending->wire = request.action;
  pending->wire.command_id =
      pending->has_key ? command_id_of(request.robot_id, request.actor, request.key) : random_id();
  pending->wire.boot_id = robot.boot_id;
  CommandRecord& record = pending->record;
  record.id = pending->wire.command_id;
  record.robot_id = robot.id;
  record.boot_id = robot.boot_id;
  record.kind = protocol::kind(request.action);
  record.arguments = request.arguments;
  record.actor = request.actor;
  record.peer = request.peer;
  record.submitted_at_us = clock_.utc_us();
  if (!pending->is_stop()) {
    // The robot's clock is not known exactly; this reading is never ahead of it, so a life can only come out shorter.
    const std::int64_t left_us = std::max<std::int64_t>((request.life - request.age).count(), 0);
    pending->wire.valid_until_robot_us = static_cast<std::uint64_t>(robot_now_us(robot) + left_us);
    pending->deadline_us = now_us + left_us;
    record.life_from = request.life_from;
  }
  return pending;
}

// What speaks against the wish; nothing is sent then.
Result<void> Station::check_request(const CommandRequest& request, const protocol::Command& wire,
                                    const Seat& seat) const {
  if (request.life <= microseconds{0} || request.life > kMaxLife) {
    return fail(ErrorCode::invalid, fmt::format("life = {} ms is outside 1 to 10000", request.life.count() / 1000),
                "out_of_range");
  }
  if (seat.port == nullptr) {
    return fail(ErrorCode::not_connected, fmt::format("robot '{}' is not connected", request.robot_id),
                "not_connected");
  }
  // SAFETY: which setpoint is in force, or where the robot has come to, no hello says.
  const bool is_shown = seat.next_sample_at_robot_us != seat.connected_at_robot_us;
  const bool is_compared = seat.robot->context.mode == rheonaut_MODE_AUTO || seat.robot->sample;
  if (setpoint_of(wire) && is_compared && !is_shown) {
    return fail(ErrorCode::invalid,
                fmt::format("robot '{}' has just connected, and what a step counts from is not known before its next "
                            "telemetry",
                            request.robot_id),
                "step_too_large");
  }
  return check_command(wire, *seat.robot, envelope_, seat.orders_ahead(&wire));
}

const CommandRecord* Station::known_command(const RobotId& robot_id, CommandId id) const {
  const auto seat = seats_.find(robot_id);
  const auto pending = seat == seats_.end() ? nullptr : seat->second.on_its_way(id);
  if (pending != nullptr) return &pending->record;
  const auto* recent = recent_.find(id);
  return recent == nullptr ? nullptr : &recent->record;
}

// A wish with a key that is on its way already, or was answered lately.
Result<std::shared_ptr<PendingCommand>> Station::same_wish(const CommandRequest& request, const Seat& seat) {
  const CommandId id = command_id_of(request.robot_id, request.actor, request.key);
  std::shared_ptr<PendingCommand> same = seat.on_its_way(id);
  if (const auto* recent = recent_.find(id); same == nullptr && recent != nullptr) {
    same = std::make_shared<PendingCommand>(loop_);
    same->record = recent->record;
  }
  const bool is_other = same != nullptr && (same->record.kind != protocol::kind(request.action) ||
                                            same->record.arguments != request.arguments);
  if (!is_other) return same;
  return fail(ErrorCode::invalid,
              fmt::format("the key '{}' was used for {} {}; a new command needs a new key", request.key,
                          same->record.kind, same->record.arguments),
              "key_reused");
}

asio::awaitable<Result<CommandRecord>> Station::submit(CommandRequest request) {
  const auto seat_entry = seats_.find(request.robot_id);
  if (seat_entry == seats_.end()) {
    Error unknown{ErrorCode::not_found, fmt::format("no robot '{}' is known", request.robot_id), "unknown_robot"};
    co_return refuse(request, std::move(unknown));
  }
  if (request.action.which_action == rheonaut_Command_emergency_stop_tag) {
    StopRequest stop{request.robot_id, request.actor, request.peer, request.key, request.received_us};
    co_return co_await emergency_stop(std::move(stop), request.life);
  }
  // SAFETY: what moves, and waited while the station stood still, is as old as that.
  if (moves_the_motor(request.action)) request.age = std::max(request.age, request.unread);
  Seat& seat = seat_entry->second;
  const microseconds patience = request.life + (request.until_verified ? kSeenPatience : kPatience);
  if (!request.key.empty()) {
    const auto same = same_wish(request, seat);
    if (!same) co_return refuse(request, same.error());
    if (*same != nullptr) co_return co_await follow(*same, request.until_verified, patience);
  }
  // SAFETY: whoever is not in control moves nothing, page, script or experiment.
  if (auto held = may_control(request); !held) co_return refuse(request, held.error());
  // SAFETY: what waits on the robot for whoever was in control before is dropped ahead of this command, or it is not
  // sent.
  const bool is_clear = !needs_control(request.action) || drop_timed(seat);
  const auto pending = make_pending(request, *seat.robot);
  if (auto checked = check_request(request, pending->wire, seat); !checked) co_return refuse(request, checked.error());
  // SAFETY: what was issued longer ago than its life is not sent, and is accounted for.
  if (request.age >= request.life) {
    end(*pending, CommandState::expired, "too_old_on_arrival");
    co_return pending->record;
  }
  if (auto seen = check_sight(request); !seen) co_return refuse(request, seen.error());
  if (auto reached = check_time(*pending, *seat.robot); !reached) co_return refuse(request, reached.error());
  supersede_queued(seat, *pending);
  if (!is_clear || !seat.port->send(pending->wire, pending->deadline_us)) {
    Error full{ErrorCode::unavailable, fmt::format("too many commands wait for robot '{}'", request.robot_id),
               "queue_full"};
    co_return refuse(request, std::move(full));
  }
  if (request.takes_control)
    use_control(request);  // SAFETY: what was refused, also by a full queue, or came too late, takes no control
  pending->is_by_holder = request.takes_control && authority_.of(request.robot_id).holder == request.actor;
  if (pending->wire.has_execute_at_robot_us) {
    seat.timed_by = request.actor;
    seat.timed_until_robot_us = std::max(seat.timed_until_robot_us, pending->wire.execute_at_robot_us);
  }
  add_pending(seat, pending);
  publish(pending->record);
  co_return co_await follow(pending, request.until_verified, patience);
}

// Nothing is sent, and the audit hears of it.
std::unexpected<Error> Station::refuse(const CommandRequest& request, Error error) {
  const char* kind = protocol::kind(request.action);
  note_refusal({request.actor, request.peer, clock_.utc_us()}, request.robot_id, "command",
               fmt::format(R"({{"kind":"{}","arguments":{}}})", kind, request.arguments), error);
  return std::unexpected{std::move(error)};
}

// What became of it, as far as that is known then.
asio::awaitable<Result<CommandRecord>> Station::follow(std::shared_ptr<PendingCommand> pending, bool until_verified,
                                                       microseconds patience) {
  const CommandRecord& record = pending->record;
  const bool is_on_its_way = record.state == CommandState::queued || record.state == CommandState::sent;
  const bool is_reached = until_verified ? record.ended_at_us != 0 : !is_on_its_way;
  Signal& reached = until_verified ? pending->ended : pending->answered;
  if (!is_reached) co_await reached.wait_until(clock_, clock_.steady_us() + patience.count());
  co_return record;
}

void Station::add_pending(Seat& seat, const std::shared_ptr<PendingCommand>& pending) {
  pending->number = ++seat.last_number;
  seat.commands.emplace(pending->record.id, pending);
  if (pending->is_stop()) seat.robot->pending_stop = pending->record.id;
}

bool is_superseded_by(const PendingCommand& older, const protocol::Command& newer) {
  const auto kind = newer.which_action;
  if (kind != rheonaut_Command_set_setpoint_tag && kind != rheonaut_Command_set_duty_tag) return false;
  if (newer.has_execute_at_robot_us || older.wire.has_execute_at_robot_us) return false;  // each at its time
  return older.record.state == CommandState::queued && older.wire.which_action == kind;
}

// SAFETY: an older setpoint, or duty, does not follow the newer one.
void Station::supersede_queued(Seat& seat, const PendingCommand& newer) {
  std::vector<CommandId> older;
  for (const auto& [id, pending] : seat.commands) {
    if (is_superseded_by(*pending, newer.wire) && seat.port->withdraw(id)) older.push_back(id);
  }
  for (const CommandId id : older) finish(seat, id, CommandState::superseded, "by_a_newer_command");
}

}  // namespace server
