// What robot sessions report: connections, frames, samples, events, answers. Each goes to the parts and to the sinks.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/station/commands/read_back.hpp"
#include "server/station/live_state.hpp"
#include "server/station/station.hpp"
#include "server/station/station_parts.hpp"

namespace server::station {
namespace {

std::string more_text(std::uint64_t withheld) {
  return withheld == 0 ? "" : fmt::format(" ({} more since the last event)", withheld);
}

std::vector<const protocol::Command*> commands_of(const std::vector<std::shared_ptr<PendingCommand>>& sent) {
  std::vector<const protocol::Command*> commands;
  commands.reserve(sent.size());
  for (const auto& pending : sent) commands.push_back(&pending->wire);
  return commands;
}

// One that came before is on disk, or counted, or will be asked for again.
void record(StationParts& parts, RobotEntry& entry, Checked<protocol::Event> checked) {
  const protocol::Event& event = *checked;
  const bool is_new = event.event_seq >= entry.next_event_seq;
  entry.next_event_seq = std::max(entry.next_event_seq, event.event_seq + 1);
  if (entry.events.take(event.kind, parts.clock.steady_us())) {
    parts.notifier.publish(entry.robot, event_of(entry.robot, checked));
  } else if (is_new) {
    parts.hold(entry, event.kind, event_of(entry.robot, checked));
  }
}

ReportMoment moment_of(const RobotEntry& entry, const runtime::Clock& clock) {
  return moment_of_report(entry.robot, entry.orders.next_sample_at_robot_us(), clock.utc_us());
}

}  // namespace

Result<void> Station::may_connect(const RobotId& id, BootId boot_id) const {
  const std::int64_t timeout_us = std::int64_t{parts_->times.link_timeout_ms} * 1000;
  return parts_->robots.may_connect(id, boot_id, parts_->clock.steady_us(), timeout_us);
}

void Station::on_connected(RobotLink& link, const AdmissionRequest& hello, const protocol::Hello& details,
                           const Admission& admission, const std::string& peer) {
  RobotEntry& entry = parts_->robots.add(hello.robot_id);
  RobotState& robot = entry.robot;
  if (RobotLink* previous = RobotTable::connect(entry, link); previous != nullptr) {
    previous->close(fmt::format("replaced by a connection from {}", peer));
    parts_->tracker.end_with_link(entry, "link_lost");  // SAFETY: what it was sent last may not have arrived
    if (parts_->end_of_recorded(entry)) {
      parts_->notifier.note(robot, "connection_replaced", fmt::format("{} takes the place of {}", peer, robot.peer));
    }
  }
  const bool is_other_boot = robot.boot_id != hello.boot_id;
  const bool lost_its_latch = robot.latched() && is_other_boot && details.emergency_id == 0;
  if (is_other_boot) entry.moves_for = parts_->control.of(robot.id).holder;
  begin_connection(entry, hello, details, admission, peer, parts_->clock.steady_us());
  parts_->publish_stops_of(
      [&](std::vector<CommandRecord>& made) { parts_->stops.on_connected(entry, lost_its_latch, made); });
  entry.timed.drop_because = "link_lost";  // as the robot drops it when it notices
  parts_->drop_outdated(entry);
  if (is_other_boot) parts_->record_held(entry, true);  // before that boot counts as ended
  parts_->record_connection(entry, false);
  parts_->notifier.publish(robot);
}

void Station::on_disconnected(RobotLink& link, const std::string& reason) {
  RobotEntry* entry = RobotTable::of(link);
  if (entry == nullptr) return;  // another connection has taken its place
  RobotTable::disconnect(*entry);
  RobotState& robot = entry->robot;
  robot.link = LinkState::disconnected;
  robot.stop_path = {.is_measured = robot.stop_path.is_measured};
  parts_->tracker.end_with_link(*entry, "link_lost");
  if (parts_->end_of_recorded(*entry)) {
    spdlog::info("robot '{}' disconnected: {}", robot.id, reason);
    parts_->notifier.note(robot, "disconnected", reason);
  }
  parts_->notifier.publish(robot);
}

void Station::on_refused(const RobotId& id, const std::string& peer, protocol::RefusalReason reason,
                         const std::string& detail) {
  RobotEntry* entry = parts_->robots.find(id);
  if (entry == nullptr) return;
  const auto withheld = entry->refusals.admit(parts_->clock.steady_us());
  if (!withheld) return;
  const char* cause = protocol::text(reason);
  parts_->notifier.note(entry->robot, "connection_refused",
                        fmt::format("{} refused, {}: {}{}", peer, cause, detail, more_text(*withheld)), cause);
}

void Station::on_enrolment_refused(const RobotId& id, const std::string& peer, const std::string& detail) {
  const auto withheld = parts_->enrolment_refusals.admit(parts_->clock.steady_us());
  if (!withheld) return;
  const std::string more = more_text(*withheld);
  spdlog::warn("robot '{}' from {} was not enrolled: {}{}", id, peer, detail, more);
  RobotState unknown;
  unknown.id = id;
  parts_->notifier.note(unknown, "enrolment_refused", fmt::format("{}: {}{}", peer, detail, more));
}

void Station::on_frame(RobotLink& link, std::uint64_t robot_time_us) {
  RobotEntry* entry = RobotTable::of(link);
  if (entry == nullptr) return;
  RobotState& robot = entry->robot;
  robot.last_received_at_us = parts_->clock.utc_us();
  robot.last_received_steady_us = parts_->clock.steady_us();
  robot.latest_robot_time_us = std::max(robot.latest_robot_time_us, robot_time_us);
  parts_->record_held(*entry, false);
  parts_->tracker.expire(*entry);
  if (!robot.pending_stop) return;
  parts_->publish_stops_of([&](std::vector<CommandRecord>& made) { parts_->stops.repeat(*entry, made); });
}

void Station::on_samples(RobotLink& link, Checked<protocol::Telemetry> telemetry) {
  RobotEntry* entry = RobotTable::of(link);
  if (entry == nullptr) return;
  RobotState& robot = entry->robot;
  SampleBatch& batch = parts_->batch;
  fill_batch(robot, telemetry, batch);
  if (show_samples(*entry, batch, parts_->limits_of(robot))) parts_->notifier.publish(robot);
  robot.oldest_seq = std::max(robot.oldest_seq, batch.oldest_seq);
  parts_->notifier.publish(robot, batch);
  parts_->tracker.on_samples(*entry, batch);
  // SAFETY: by now every acknowledgement has come of what the robot dropped together; what is left was judged wrongly.
  TimedOrders& timed = entry->timed;
  const bool waits = !timed.by.actor.empty();
  if (waits && entry->orders.begins_too_far_away(robot, entry->commands, parts_->limits_of(robot))) {
    timed.drop_because = "step_too_large";
  }
  if (timed.has_lost_a_step || timed.drop_because != nullptr) parts_->drop_outdated(*entry);
  parts_->tracker.settle_unanswered(*entry, batch);
}

void Station::on_event(RobotLink& link, Checked<protocol::Event> event) {
  RobotEntry* entry = RobotTable::of(link);
  if (entry == nullptr) return;
  record(*parts_, *entry, event);
  entry->orders.note_event(*event);
  parts_->tracker.on_event(*entry, *event);
}

void Station::on_invalid_values(RobotLink& link, std::uint64_t count, const char* cause, const std::string& first) {
  RobotEntry* entry = RobotTable::of(link);
  if (entry == nullptr) return;
  parts_->invalid_values += count;
  entry->robot.invalid_values += count;
  const auto withheld = entry->invalid_values.admit(parts_->clock.steady_us(), count);
  if (!withheld) return;
  std::string detail = first + more_text(*withheld + count - 1);
  spdlog::warn("robot '{}' sends what cannot be: {}", entry->robot.id, detail);
  parts_->notifier.note(entry->robot, "invalid_value", std::move(detail), cause);
}

void Station::on_unusable_samples(RobotLink& link, const protocol::Telemetry& telemetry) {
  const RobotEntry* entry = RobotTable::of(link);
  if (entry == nullptr) return;
  const std::uint64_t next_seq = telemetry.first_seq + telemetry.position_m_count;
  parts_->notifier.publish_unusable_samples(entry->robot, telemetry.first_seq, next_seq);
}

void Station::on_unusable_event(RobotLink& link, const protocol::Event& event) {
  const RobotEntry* entry = RobotTable::of(link);
  if (entry != nullptr) parts_->notifier.publish_unusable_event(entry->robot, event.event_seq);
}

void Station::on_status(RobotLink& link, const protocol::Status& status) {
  RobotEntry* entry = RobotTable::of(link);
  if (entry == nullptr) return;
  entry->robot.status = status;
  parts_->notifier.publish(entry->robot);
}

void Station::on_command_sent(RobotLink& link, CommandId id) {
  if (RobotEntry* entry = RobotTable::of(link)) parts_->tracker.on_sent(*entry, id);
}

void Station::on_command_ack(RobotLink& link, const protocol::CommandAck& ack) {
  RobotEntry* entry = RobotTable::of(link);
  if (entry == nullptr) return;
  const auto pending = parts_->tracker.find_answered(*entry, ack);
  if (pending == nullptr) return;
  if (pending->is_stop()) {
    const auto settled = parts_->stops.on_answer(*entry, *pending, ack);
    if (settled.empty()) return;
    for (const auto& [id, reason] : settled) parts_->tracker.acknowledge(*entry, id, reason);
    EmergencyStops::show_pending(*entry);
  } else {
    parts_->tracker.on_answer(*entry, *pending, ack);
    const bool is_renewal = pending->wire.which_action == rheonaut_Command_renew_lease_tag;
    if (is_renewal && was_accepted(pending->record.state)) entry->robot.lease_renewed_at_us = parts_->clock.utc_us();
  }
  parts_->notifier.publish(entry->robot);
}

void Station::on_clock(RobotLink& link, const ClockExchange& exchange) {
  RobotEntry* entry = RobotTable::of(link);
  if (entry == nullptr) return;
  RobotState& robot = entry->robot;
  const std::int64_t held_us = exchange.answered_at_robot_us - exchange.received_at_robot_us;
  const std::int64_t round_trip_us = exchange.answer_received_at_us - exchange.sent_at_us - held_us;
  // Times of a robot that cannot be: they would spoil the sum for all robots.
  if (held_us >= 0 && round_trip_us >= 0) parts_->round_trips.add(round_trip_us);
  const std::int64_t utc_minus_steady_us = parts_->clock.utc_us() - parts_->clock.steady_us();
  const auto report = entry->reported.add(exchange, robot, utc_minus_steady_us);
  robot.clock = report.estimate;
  if (report.station_step_us != 0) {
    parts_->notifier.note(robot, "station_clock_set", fmt::format("by {} ms", report.station_step_us / 1000));
  }
  if (report.record) parts_->notifier.publish(robot, *report.record);
}

// Its latency is published with the state that follows each Status.
void Station::on_stop_path(RobotLink& link, const StopPath& path) {
  RobotEntry* entry = RobotTable::of(link);
  if (entry == nullptr) return;
  RobotState& robot = entry->robot;
  const bool has_changed = path.is_open != robot.stop_path.is_open;
  robot.stop_path = path;
  if (has_changed) parts_->notifier.publish(robot);
}

bool Station::is_attended(const RobotLink& link) const {
  const RobotEntry* entry = RobotTable::of(link);
  if (entry == nullptr) return false;
  const RobotState& robot = entry->robot;
  const bool is_commanded = robot.pending_stop || !robot.control.holder.empty() || !entry->timed.by.actor.empty();
  return is_commanded || !entry->commands.is_empty() || parts_->notifier.is_watched(robot.id);
}

void Station::on_parameters(RobotLink& link, const protocol::ParameterPage& page) {
  RobotEntry* entry = RobotTable::of(link);
  if (entry == nullptr) return;
  RobotState& robot = entry->robot;
  if (const auto record = entry->reported.add(page, moment_of(*entry, parts_->clock))) {
    parts_->notifier.publish(robot, *record);
    const ParameterTable& table = entry->reported.settings().parameters;
    const std::uint32_t checksum_before = std::exchange(robot.parameters_checksum, table.checksum());
    const auto changed_before = std::exchange(robot.changed_limits, table.changed_limits());
    const bool is_other = checksum_before != robot.parameters_checksum || changed_before != robot.changed_limits;
    if (is_other) parts_->notifier.publish(robot);
  }
  const auto sent = entry->commands.to_be_read_back();
  parts_->tracker.on_read_back(*entry, sent, read_back(commands_of(sent), page));
}

void Station::on_controller(RobotLink& link, const protocol::Controller& controller) {
  RobotEntry* entry = RobotTable::of(link);
  if (entry == nullptr) return;
  const auto sent = entry->commands.to_be_read_back();
  const ControllerReading reading = read_back(commands_of(sent), entry->reported.settings(), controller);
  const auto record = entry->reported.add(controller, reading.former, moment_of(*entry, parts_->clock));
  parts_->notifier.publish(entry->robot, record);
  if (entry->robot.controller_checksum != controller.checksum) {  // that of Hello is older
    entry->robot.controller_checksum = controller.checksum;
    parts_->notifier.publish(entry->robot);
  }
  parts_->tracker.on_read_back(*entry, sent, reading.sights);
}

}  // namespace server::station
