#include "server/station/emergency_stops.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <string_view>

namespace server::station {
namespace {

constexpr microseconds kRepeatStop{1'000'000};
constexpr microseconds kSamePress{10'000'000};
constexpr std::string_view kStop = "emergency_stop";  // of a record
constexpr std::size_t kMaxStops = 16;  // on their way to one robot; who asks for more waits for the newest of them
constexpr microseconds kMayStillMove{60'000'000};  // twice the longest that a robot goes on without its link

// While it lives, what the link sends is appended to the list and not published.
class HeldBack {
 public:
  HeldBack(RobotCommands& commands, std::vector<CommandRecord>& into) : commands_{commands} {
    commands_.sent_with_stop = &into;
  }
  ~HeldBack() { commands_.sent_with_stop = nullptr; }
  HeldBack(const HeldBack&) = delete;
  HeldBack& operator=(const HeldBack&) = delete;

 private:
  RobotCommands& commands_;
};

}  // namespace

bool EmergencyStops::may_be_left_out(const RobotEntry& entry) const {
  const RobotState& robot = entry.robot;
  if (robot.retired_at_us == 0 || entry.link != nullptr) return false;
  const std::int64_t last_received_us = std::max(robot.last_received_steady_us, started_us_);
  return clock_.steady_us() - last_received_us > kMayStillMove.count();
}

std::shared_ptr<PendingCommand> EmergencyStops::begin(RobotEntry& entry, const StopRequest& stop_request,
                                                      std::vector<CommandRecord>& to_publish) {
  if (auto same = stop_in_force(entry, stop_request)) return same;
  CommandRequest request;
  request.actor = stop_request.actor;
  request.peer = stop_request.peer;
  request.received_us = stop_request.received_us;
  // SAFETY: a key that has been used, by a command of any kind, is no reason not to stop.
  const CommandId id = command_id_of(entry.robot.id, stop_request.actor, stop_request.key);
  if (!recent_.find(id) && !entry.commands.find_unanswered(id)) request.key = stop_request.key;
  const auto stop = make(entry, request);
  stop->is_timed = entry.link != nullptr;
  hand(entry, *stop, to_publish);  // SAFETY: the frame first, the record afterwards
  if (stop->record.state == CommandState::queued) to_publish.push_back(stop->record);
  return stop;
}

std::shared_ptr<PendingCommand> EmergencyStops::make(RobotEntry& entry, const CommandRequest& request) {
  CommandRequest stop_request = request;
  stop_request.robot_id = entry.robot.id;
  stop_request.action = rheonaut_Command_init_zero;
  stop_request.action.which_action = rheonaut_Command_emergency_stop_tag;
  const auto stop = make_pending(loop_, clock_, stop_request, entry.robot);
  entry.commands.add(stop);
  entry.robot.pending_stop = stop->record.id;
  return stop;
}

// SAFETY: only a stop that came with the same
// key within 10 s and still latches the robot; or the newest, when the robot is away or has as many as it can be given.
std::shared_ptr<PendingCommand> EmergencyStops::stop_in_force(RobotEntry& entry, const StopRequest& request) {
  if (!request.key.empty()) {
    const CommandId id = command_id_of(entry.robot.id, request.actor, request.key);
    if (auto same = entry.commands.find_unanswered(id); same != nullptr && same->is_stop()) return same;
    const auto* recent = recent_.find(id);
    const bool is_same_press = recent != nullptr && recent->record.kind == kStop && entry.robot.latched() &&
                               clock_.steady_us() - recent->answered_us < kSamePress.count();
    if (is_same_press) return answered_before(loop_, recent->record);
  }
  const auto newest = entry.commands.newest_stop();
  return entry.link == nullptr || entry.commands.stops() >= kMaxStops ? newest : nullptr;
}

// SAFETY: the session writes it before anything else; what was queued for the robot never reaches it.
void EmergencyStops::hand(RobotEntry& entry, PendingCommand& stop, std::vector<CommandRecord>& to_publish) {
  if (entry.link == nullptr) return;
  stop.handed_at_us = clock_.steady_us();
  {
    const HeldBack held_back{entry.commands, to_publish};
    entry.link->send_emergency_stop(stop.wire);
  }
  for (const CommandId id : entry.commands.queued()) {
    const auto superseded = entry.commands.take_unanswered(id);
    end_command(*superseded, CommandState::superseded, "by_emergency_stop", clock_, recent_);
    to_publish.push_back(superseded->record);
  }
}

void EmergencyStops::on_connected(RobotEntry& entry, bool lost_its_latch, std::vector<CommandRecord>& to_publish) {
  if (const auto stop = entry.commands.newest_stop(); stop != nullptr) return hand(entry, *stop, to_publish);
  if (!lost_its_latch) return;
  CommandRequest request;
  request.actor = "station:latch";
  const auto relatch = make(entry, request);
  hand(entry, *relatch, to_publish);
  if (relatch->record.state == CommandState::queued) to_publish.push_back(relatch->record);
}

void EmergencyStops::repeat(RobotEntry& entry, std::vector<CommandRecord>& to_publish) {
  if (!entry.robot.pending_stop) return;
  const auto stop = entry.commands.newest_stop();
  const bool is_due = stop != nullptr && clock_.steady_us() - stop->handed_at_us >= kRepeatStop.count();
  if (is_due) hand(entry, *stop, to_publish);
}

void EmergencyStops::restore(RobotEntry& entry, const CommandRecord& record) {
  const auto pending = answered_before(loop_, record);
  pending->received_us = clock_.steady_us() - std::max<std::int64_t>(clock_.utc_us() - record.submitted_at_us, 0);
  pending->wire.command_id = record.id;
  pending->wire.which_action = rheonaut_Command_emergency_stop_tag;
  entry.commands.add(pending);
  entry.robot.pending_stop = record.id;
  spdlog::warn("an emergency stop of robot '{}' waits for the robot to return", record.robot_id);
}

// The robot stands latched: this stop and those asked for before it have reached their purpose. A later one has not.
std::vector<std::pair<CommandId, const char*>> EmergencyStops::on_answer(RobotEntry& entry,
                                                                         const PendingCommand& answered,
                                                                         const protocol::CommandAck& ack) {
  RobotState& robot = entry.robot;
  const bool obeyed = ack.result == rheonaut_COMMAND_RESULT_ACCEPTED || ack.result == rheonaut_COMMAND_RESULT_DUPLICATE;
  if (!obeyed || ack.emergency_id == 0) {
    spdlog::error("robot '{}' answered an emergency stop with {} and latch {}; it is sent again", robot.id,
                  protocol::text(ack.result), ack.emergency_id);
    return {};
  }
  // A stop that was repeated is answered without a time: what it says is as new as its frame.
  const std::uint64_t known_at_us = ack.effect_at_robot_us != 0 ? ack.effect_at_robot_us : robot.latest_robot_time_us;
  if (known_at_us >= entry.latch_known_at_robot_us) {
    entry.latch_known_at_robot_us = known_at_us;
    robot.context.emergency_id = ack.emergency_id;
    robot.context.emergency_cause = rheonaut_EMERGENCY_CAUSE_OPERATOR;
  }
  std::vector<std::pair<CommandId, const char*>> settled;
  for (const auto& [id, pending] : entry.commands.unanswered) {
    if (!pending->is_stop() || pending->number > answered.number) continue;
    pending->record.effect_at_robot_us = ack.effect_at_robot_us;
    pending->record.emergency_id = ack.emergency_id;
    settled.emplace_back(id, id == answered.record.id ? "" : "stopped_by_a_later_stop");
  }
  return settled;
}

void EmergencyStops::show_pending(RobotEntry& entry) {
  const auto still = entry.commands.newest_stop();
  entry.robot.pending_stop = still == nullptr ? std::nullopt : std::optional{still->record.id};
}

}  // namespace server::station
