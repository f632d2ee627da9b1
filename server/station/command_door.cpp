// The one door for commands: from a request to acknowledged, rejected, expired or failed.
#include <sodium.h>
#include <spdlog/spdlog.h>

#include <fmt/format.h>
#include <algorithm>
#include <boost/asio/experimental/awaitable_operators.hpp>

#include "server/station/seat.hpp"

namespace server {
namespace asio = boost::asio;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

namespace {

constexpr microseconds kMaxLife{protocol::kMaxCommandLifeUs};
constexpr microseconds kRepeatStop{1'000'000};
constexpr std::size_t kMaxStops = 16;  // on their way to one robot; who asks for more waits for the newest of them
constexpr microseconds kAckGrace{1'000'000};  // an answer may come this much after the life ended

CommandId random_id() {
  CommandId id = 0;
  while (id == 0) randombytes_buf(&id, sizeof id);
  return id;
}

}  // namespace

const char* text(CommandState value) {
  switch (value) {
    case CommandState::queued: return "queued";
    case CommandState::sent: return "sent";
    case CommandState::acknowledged: return "acknowledged";
    case CommandState::rejected: return "rejected";
    case CommandState::expired: return "expired";
    case CommandState::failed: return "failed";
  }
  return "unknown";
}

std::shared_ptr<Station::PendingCommand> Station::make_pending(const CommandRequest& request, const RobotState& robot) {
  auto pending = std::make_shared<PendingCommand>(loop_);
  pending->wire = request.action;
  pending->wire.command_id = random_id();
  pending->wire.boot_id = robot.boot_id;
  CommandRecord& record = pending->record;
  record.id = pending->wire.command_id;
  record.robot_id = robot.id;
  record.boot_id = robot.boot_id;
  record.kind = protocol::kind(request.action);
  record.arguments = request.arguments;
  record.actor = request.actor;
  record.submitted_at_us = clock_.utc_us();
  if (!pending->is_stop()) {
    // The robot's clock is not known exactly; this reading is never ahead of it, so a life can only come out shorter.
    pending->wire.valid_until_robot_us = static_cast<std::uint64_t>(robot_now_us(robot) + request.life.count());
    pending->deadline_us = clock_.steady_us() + request.life.count();
  }
  return pending;
}

asio::awaitable<Result<CommandRecord>> Station::submit(CommandRequest request) {
  const auto seat_entry = seats_.find(request.robot_id);
  if (seat_entry == seats_.end()) {
    co_return fail(ErrorCode::not_found, fmt::format("no robot '{}' is known", request.robot_id), "unknown_robot");
  }
  if (request.action.which_action == rheonaut_Command_emergency_stop_tag) {
    co_return co_await emergency_stop(request.robot_id, request.actor, request.life);
  }
  if (request.life <= microseconds{0} || request.life > kMaxLife) {
    co_return fail(ErrorCode::invalid, fmt::format("life = {} ms is outside 1 to 10000", request.life.count() / 1000),
                   "out_of_range");
  }
  Seat& seat = seat_entry->second;
  if (seat.port == nullptr) {
    co_return fail(ErrorCode::not_connected, fmt::format("robot '{}' is not connected", request.robot_id),
                   "not_connected");
  }
  if (auto checked = check_command(request.action, *seat.robot, limits_); !checked) {
    co_return std::unexpected{checked.error()};
  }
  const auto pending = make_pending(request, *seat.robot);
  if (!seat.port->send(pending->wire, pending->deadline_us)) {
    co_return fail(ErrorCode::unavailable, fmt::format("too many commands wait for robot '{}'", request.robot_id),
                   "queue_full");
  }
  add_pending(seat, pending);
  publish(pending->record);
  co_await (pending->ended.wait() || clock_.sleep_for(request.life + 2 * kAckGrace));
  co_return pending->record;
}

asio::awaitable<Result<CommandRecord>> Station::emergency_stop(RobotId robot_id, std::string actor,
                                                               microseconds patience) {
  const auto seat_entry = seats_.find(robot_id);
  if (seat_entry == seats_.end()) {
    co_return fail(ErrorCode::not_found, fmt::format("no robot '{}' is known", robot_id), "unknown_robot");
  }
  Seat& seat = seat_entry->second;
  auto stop = seat.newest_stop();
  if (stop == nullptr || (seat.port != nullptr && seat.stops() < kMaxStops)) {
    CommandRequest request;
    request.robot_id = robot_id;
    request.action.which_action = rheonaut_Command_emergency_stop_tag;
    request.actor = std::move(actor);
    stop = make_pending(request, *seat.robot);
    add_pending(seat, stop);
    hand_stop_to(seat, *stop);  // SAFETY: the frame first, the record afterwards
    spdlog::warn("emergency stop of robot '{}' by {}{}", robot_id, stop->record.actor,
                 seat.port == nullptr ? "; kept until it returns" : "");
    if (stop->record.state == CommandState::queued) publish(stop->record);
    publish(*seat.robot);
  }
  co_await (stop->ended.wait() || clock_.sleep_for(patience));
  co_return stop->record;
}

void Station::add_pending(Seat& seat, const std::shared_ptr<PendingCommand>& pending) {
  pending->number = ++seat.last_number;
  seat.commands.emplace(pending->record.id, pending);
  if (pending->is_stop()) seat.robot->pending_stop = pending->record.id;
}

std::shared_ptr<Station::PendingCommand> Station::Seat::newest_stop() const {
  std::shared_ptr<PendingCommand> newest;
  for (const auto& [id, pending] : commands) {
    if (pending->is_stop() && (newest == nullptr || pending->number > newest->number)) newest = pending;
  }
  return newest;
}

std::size_t Station::Seat::stops() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(commands, [](const auto& entry) { return entry.second->is_stop(); }));
}

// SAFETY: the session writes it before anything else; what was queued for the robot never reaches it.
void Station::hand_stop_to(Seat& seat, PendingCommand& stop) {
  if (seat.port == nullptr) return;
  stop.handed_at_us = clock_.steady_us();
  seat.port->send_emergency_stop(stop.wire);
  std::vector<CommandId> superseded;
  for (const auto& [id, pending] : seat.commands) {
    if (!pending->is_stop() && pending->record.state == CommandState::queued) superseded.push_back(id);
  }
  for (const CommandId id : superseded) finish(seat, id, CommandState::failed, "superseded_by_emergency_stop");
}

// SAFETY: a stop that a connected robot leaves unanswered is sent again each second, under the same id.
void Station::repeat_stop(Seat& seat) {
  if (!seat.robot->pending_stop) return;
  const auto stop = seat.newest_stop();
  if (stop != nullptr && clock_.steady_us() - stop->handed_at_us >= kRepeatStop.count()) hand_stop_to(seat, *stop);
}

void Station::restore_stop(const CommandRecord& record) {
  Seat& seat = add_seat(record.robot_id);
  auto pending = std::make_shared<PendingCommand>(loop_);
  pending->record = record;
  pending->wire.command_id = record.id;
  pending->wire.which_action = rheonaut_Command_emergency_stop_tag;
  add_pending(seat, pending);
  spdlog::warn("an emergency stop of robot '{}' waits for the robot to return", record.robot_id);
}

void Station::on_command_sent(RobotPort& port, CommandId id) {
  Seat* seat = seat_of(port);
  if (seat == nullptr) return;
  const auto pending = seat->commands.find(id);
  if (pending == seat->commands.end() || pending->second->record.state != CommandState::queued) return;
  pending->second->record.state = CommandState::sent;
  pending->second->record.sent_at_us = clock_.utc_us();
  publish(pending->second->record);
}

void Station::on_command_ack(RobotPort& port, const protocol::CommandAck& ack) {
  Seat* seat = seat_of(port);
  if (seat == nullptr) return;
  const auto entry = seat->commands.find(ack.command_id);
  if (entry == seat->commands.end()) return;  // ended already
  const auto pending = entry->second;
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
    case rheonaut_COMMAND_RESULT_ACCEPTED: finish(*seat, record.id, CommandState::acknowledged, ""); break;
    case rheonaut_COMMAND_RESULT_EXPIRED: finish(*seat, record.id, CommandState::expired, "expired"); break;
    case rheonaut_COMMAND_RESULT_REJECTED:
      finish(*seat, record.id, CommandState::rejected, protocol::text(ack.reason));
      break;
    default: finish(*seat, record.id, CommandState::rejected, protocol::text(ack.result)); break;
  }
  publish(*seat->robot);
}

// The robot stands latched: this stop and those asked for before it have reached their purpose. A later one has not.
void Station::settle_stops(Seat& seat, const PendingCommand& acknowledged, const protocol::CommandAck& ack) {
  RobotState& robot = *seat.robot;
  const bool obeyed = ack.result == rheonaut_COMMAND_RESULT_ACCEPTED || ack.result == rheonaut_COMMAND_RESULT_DUPLICATE;
  if (!obeyed || ack.emergency_id == 0) {
    spdlog::error("robot '{}' answered an emergency stop with {} and latch {}; it is sent again", robot.id,
                  protocol::text(ack.result), ack.emergency_id);
    return;
  }
  // A stop that was repeated is answered without a time: what it says is as new as its frame.
  const std::uint64_t known_at_us = ack.effect_at_robot_us != 0 ? ack.effect_at_robot_us : robot.latest_robot_time_us;
  if (known_at_us >= seat.latch_known_at_robot_us) {
    seat.latch_known_at_robot_us = known_at_us;
    robot.context.emergency_id = ack.emergency_id;
    robot.context.emergency_cause = rheonaut_EMERGENCY_CAUSE_OPERATOR;
  }
  const CommandId acknowledged_id = acknowledged.record.id;
  std::vector<CommandId> settled;
  for (const auto& [id, pending] : seat.commands) {
    if (!pending->is_stop() || pending->number > acknowledged.number) continue;
    pending->record.effect_at_robot_us = ack.effect_at_robot_us;
    pending->record.emergency_id = ack.emergency_id;
    settled.push_back(id);
  }
  for (const CommandId id : settled) {
    finish(seat, id, CommandState::acknowledged, id == acknowledged_id ? "" : "stopped_by_a_later_stop");
  }
  const auto still = seat.newest_stop();
  robot.pending_stop = still == nullptr ? std::nullopt : std::optional{still->record.id};
  publish(robot);
}

void Station::finish(Seat& seat, CommandId id, CommandState state, std::string reason) {
  const auto entry = seat.commands.find(id);
  if (entry == seat.commands.end()) return;
  const auto pending = entry->second;
  seat.commands.erase(entry);
  pending->record.state = state;
  pending->record.reason = std::move(reason);
  pending->record.ended_at_us = clock_.utc_us();
  publish(pending->record);
  pending->ended.notify();
}

void Station::expire_commands(Seat& seat) {
  if (seat.commands.empty()) return;
  const std::int64_t now_us = clock_.steady_us();
  std::vector<CommandId> expired;
  for (const auto& [id, pending] : seat.commands) {
    if (pending->is_stop()) continue;
    const std::int64_t grace_us = pending->record.state == CommandState::queued ? 0 : kAckGrace.count();
    if (now_us >= pending->deadline_us + grace_us) expired.push_back(id);
  }
  for (const CommandId id : expired) {
    const bool sent = seat.commands.at(id)->record.state == CommandState::sent;
    finish(seat, id, CommandState::expired, sent ? "no_answer" : "not_sent_in_time");
  }
}

}  // namespace server
