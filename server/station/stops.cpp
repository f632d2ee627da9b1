// The lane of emergency stops: ahead of everything, kept until a robot has obeyed, repeated while it has not.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <set>

#include "server/station/seat.hpp"

namespace server {
namespace asio = boost::asio;

namespace {

constexpr microseconds kRepeatStop{1'000'000};
constexpr microseconds kSamePress{10'000'000};
constexpr std::size_t kMaxStops = 16;  // on their way to one robot; who asks for more waits for the newest of them
constexpr microseconds kMayStillMove{60'000'000};  // twice the longest that a robot goes on without its link

}  // namespace

asio::awaitable<Result<CommandRecord>> Station::emergency_stop(StopRequest request, microseconds patience) {
  const auto seat = seats_.find(request.robot_id);
  if (seat == seats_.end()) {
    Error error{ErrorCode::not_found, fmt::format("no robot '{}' is known", request.robot_id), "unknown_robot"};
    note_refusal({request.actor, request.peer, clock_.utc_us()}, request.robot_id, "command",
                 R"({"kind":"emergency_stop"})", error);
    co_return std::unexpected{std::move(error)};
  }
  const auto stop = begin_stop(seat->second, request);
  const bool is_connected = seat->second.port != nullptr;
  auto outcome = co_await follow(stop, false, patience);
  // The log can wait: it is written once the answer has gone.
  asio::post(loop_, [request = std::move(request), record = *outcome, is_connected] {
    const char* state = is_connected ? text(record.state) : "kept until it returns";
    spdlog::warn("emergency stop of robot '{}' by {}: {}", request.robot_id, request.actor, state);
  });
  co_return outcome;
}

asio::awaitable<StopsOfAll> Station::stop_all(StopRequest request, microseconds patience) {
  const std::int64_t deadline_us = clock_.steady_us() + patience.count();
  std::vector<std::pair<std::shared_ptr<PendingCommand>, bool>> stops;  // and whether the robot is there
  StopsOfAll outcome;
  held_back_.emplace();
  for (auto& [id, seat] : seats_) {
    if (may_be_left_out(seat)) {
      outcome.left_out.push_back(id);
      continue;
    }
    request.robot_id = id;
    try {
      stops.emplace_back(begin_stop(seat, request), seat.port != nullptr);
    } catch (const std::exception& error) {  // SAFETY: the others are stopped all the same
      spdlog::error("emergency stop of robot '{}': {}", id, error.what());
      outcome.failed.push_back(id);
    }
  }
  publish_held_back(outcome.failed);
  spdlog::warn("emergency stop of all {} robots by {}; {} retired ones are not connected and left out", stops.size(),
               request.actor, outcome.left_out.size());
  for (const auto& [stop, is_connected] : stops) {
    const microseconds left{is_connected ? std::max<std::int64_t>(deadline_us - clock_.steady_us(), 0) : 0};
    if (left.count() > 0) co_await follow(stop, false, left);
    const bool has_failed = std::ranges::find(outcome.failed, stop->record.robot_id) != outcome.failed.end();
    if (!has_failed) outcome.records.push_back(stop->record);
  }
  co_return outcome;
}

// SAFETY: only a retired robot that is not connected, and cannot move any more: without its link it may go on for a
// while. What it did before this station started is not known, so one that may come back from there is stopped, too.
bool Station::may_be_left_out(const Seat& seat) const {
  const RobotState& robot = *seat.robot;
  if (robot.retired_at_us == 0 || seat.port != nullptr) return false;
  const std::int64_t heard_us = std::max(robot.last_received_steady_us, started_us_);
  return clock_.steady_us() - heard_us > kMayStillMove.count();
}

// What was to be told of the stops while their frames were being written.
void Station::publish_held_back(std::vector<RobotId>& failed) {
  const std::vector<CommandRecord> records = std::move(held_back_).value();
  held_back_.reset();
  std::set<RobotId> told;
  for (const CommandRecord& record : records) {
    try {
      publish(record);
      if (told.insert(record.robot_id).second) publish(robots_.at(record.robot_id));
    } catch (const std::exception& error) {
      spdlog::error("emergency stop of robot '{}': {}", record.robot_id, error.what());
      if (std::ranges::find(failed, record.robot_id) == failed.end()) failed.push_back(record.robot_id);
    }
  }
}

// Hands the stop to the link, or finds the one that is the answer already.
std::shared_ptr<PendingCommand> Station::begin_stop(Seat& seat, const StopRequest& request) {
  if (auto same = stop_in_force(seat, request)) return same;
  CommandRequest wish;
  wish.robot_id = request.robot_id;
  wish.action.which_action = rheonaut_Command_emergency_stop_tag;
  wish.actor = request.actor;
  wish.peer = request.peer;
  wish.received_us = request.received_us;
  // SAFETY: a key that has been used is no reason not to stop again.
  if (!recent_.find(command_id_of(wish.robot_id, wish.actor, request.key))) wish.key = request.key;
  const auto stop = make_pending(wish, *seat.robot);
  stop->is_timed = seat.port != nullptr;
  add_pending(seat, stop);
  hand_stop_to(seat, *stop);  // SAFETY: the frame first, the record afterwards
  if (stop->record.state == CommandState::queued) publish(stop->record);
  if (!held_back_) publish(*seat.robot);
  return stop;
}

// The stop that answers the request already; null when a new one is needed. SAFETY: only one that came with the same
// key within 10 s and still latches the robot; or the newest, when the robot is away or has as many as it can be given.
std::shared_ptr<PendingCommand> Station::stop_in_force(Seat& seat, const StopRequest& request) {
  if (!request.key.empty()) {
    const CommandId id = command_id_of(request.robot_id, request.actor, request.key);
    if (const auto unanswered = seat.commands.find(id); unanswered != seat.commands.end()) return unanswered->second;
    const auto* recent = recent_.find(id);
    const bool is_same_press =
        recent != nullptr && seat.robot->latched() && clock_.steady_us() - recent->answered_us < kSamePress.count();
    if (is_same_press) {
      auto same = std::make_shared<PendingCommand>(loop_);
      same->record = recent->record;
      return same;
    }
  }
  const auto newest = seat.newest_stop();
  return seat.port == nullptr || seat.stops() >= kMaxStops ? newest : nullptr;
}

std::shared_ptr<PendingCommand> Seat::newest_stop() const {
  std::shared_ptr<PendingCommand> newest;
  for (const auto& [id, pending] : commands) {
    if (pending->is_stop() && (newest == nullptr || pending->number > newest->number)) newest = pending;
  }
  return newest;
}

std::shared_ptr<PendingCommand> Seat::on_its_way(CommandId id) const {
  if (const auto sent = commands.find(id); sent != commands.end()) return sent->second;
  for (const auto* acknowledged : {&unseen, &unread}) {
    const auto found = std::ranges::find(*acknowledged, id, [](const auto& pending) { return pending->record.id; });
    if (found != acknowledged->end()) return *found;
  }
  return nullptr;
}

std::size_t Seat::stops() const {
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
  for (const CommandId id : superseded) finish(seat, id, CommandState::superseded, "by_emergency_stop");
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
  pending->received_us = clock_.steady_us() - std::max<std::int64_t>(clock_.utc_us() - record.submitted_at_us, 0);
  pending->wire.command_id = record.id;
  pending->wire.which_action = rheonaut_Command_emergency_stop_tag;
  add_pending(seat, pending);
  spdlog::warn("an emergency stop of robot '{}' waits for the robot to return", record.robot_id);
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
  for (const CommandId id : settled) acknowledge(seat, id, id == acknowledged_id ? "" : "stopped_by_a_later_stop");
  const auto still = seat.newest_stop();
  robot.pending_stop = still == nullptr ? std::nullopt : std::optional{still->record.id};
  publish(robot);
}

}  // namespace server
