// Live state: robots come and go, samples and events pass through to the sinks.
// LONG: what the sessions report is in one place; the doors for people and scripts are in files of their own.
#include "server/station/station.hpp"

#include <spdlog/spdlog.h>

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "server/station/seat.hpp"
#include "server/station/state/unknown_values.hpp"

namespace server {
namespace {

constexpr std::int64_t kRefusalPeriodUs = 10'000'000;
constexpr std::int64_t kInvalidPeriodUs = 10'000'000;

}  // namespace

const char* text(LinkState value) { return value == LinkState::connected ? "connected" : "disconnected"; }

Station::Station(boost::asio::io_context& loop, Clock& clock, Envelope envelope, LinkTimes times)
    : loop_{loop}, clock_{clock}, envelope_{std::move(envelope)}, times_{times}, authority_{clock} {}

Station::~Station() = default;

void Station::add_sink(StationSink& sink) { sinks_.push_back(&sink); }

void Station::restore(const std::vector<RestoredRobot>& robots, const std::vector<CommandRecord>& pending_stops) {
  for (const RestoredRobot& restored : robots) {
    RobotState& robot = *add_seat(restored.id).robot;
    robot.boot_id = restored.boot_id;
    robot.context.emergency_id = restored.emergency_id;  // SAFETY: the station's latch outlives the station
    robot.retired_at_us = restored.retired_at_us;
    restore_fluid(robot, restored.fluid);
  }
  for (const CommandRecord& record : pending_stops) restore_stop(record);
}

const RobotSettings* Station::settings(const RobotId& id) const {
  const auto seat = seats_.find(id);
  return seat == seats_.end() ? nullptr : &seat->second.settings;
}

const RobotState* Station::find(const RobotId& id) const {
  const auto robot = robots_.find(id);
  return robot == robots_.end() ? nullptr : &robot->second;
}

Seat& Station::add_seat(const RobotId& id) {
  RobotState& robot = robots_[id];
  robot.id = id;
  Seat& seat = seats_[id];
  seat.robot = &robot;
  return seat;
}

std::int64_t Station::robot_now_us(const RobotState& robot) const {
  return static_cast<std::int64_t>(robot.latest_robot_time_us) + clock_.steady_us() - robot.last_received_steady_us;
}

void Station::publish(const RobotState& robot) {
  for (StationSink* sink : sinks_) sink->on_robot(robot);
}

void Station::publish(const CommandRecord& record) {
  if (held_back_) return held_back_->push_back(record);
  for (StationSink* sink : sinks_) sink->on_command(record);
}

// An event of the station itself about a robot. Its kind has a row in docs/database.md: tests/check_docs.py compares
// the table with the literals of the calls.
void Station::note(const RobotState& robot, std::string kind, std::string detail, std::string cause) {
  RobotEvent event;
  event.robot_id = robot.id;
  event.boot_id = robot.boot_id;
  event.kind = std::move(kind);
  event.cause = std::move(cause);
  event.detail = std::move(detail);
  event.emergency_id = robot.context.emergency_id;
  event.emergency_cause = robot.context.emergency_cause;
  event.unknown_values = unknown_values(robot.context);
  event.mode = robot.context.mode;
  event.sub_state = robot.context.sub_state;
  event.robot_time_us = robot.latest_robot_time_us;
  event.received_at_us = clock_.utc_us();
  for (StationSink* sink : sinks_) sink->on_event(robot, event);
}

Result<void> Station::may_connect(const RobotId& id, BootId boot_id) const {
  const auto seat = seats_.find(id);
  if (seat == seats_.end() || seat->second.port == nullptr) return {};
  const RobotState& robot = robots_.at(id);
  if (robot.boot_id == boot_id) return {};
  const std::int64_t silent_us = clock_.steady_us() - robot.last_received_steady_us;
  if (silent_us >= std::int64_t{times_.link_timeout_ms} * 1000) return {};
  return fail(ErrorCode::conflict, fmt::format("robot '{}' is connected from {} with boot {}; it was heard {} ms ago",
                                               id, robot.peer, robot.boot_id, silent_us / 1000));
}

void Station::on_connected(RobotPort& port, const AdmissionRequest& hello, const protocol::Hello& details,
                           const Admission& admission, const std::string& peer) {
  Seat& seat = add_seat(hello.robot_id);
  RobotState& robot = *seat.robot;
  if (RobotPort* previous = std::exchange(seat.port, nullptr); previous != nullptr) {
    previous->seat_ = nullptr;
    previous->close(fmt::format("replaced by a connection from {}", peer));
    note(robot, "connection_replaced", fmt::format("{} takes the place of {}", peer, robot.peer));
  }
  const bool was_latched = robot.latched();
  const bool other_boot = robot.boot_id != hello.boot_id;
  if (other_boot) robot.sample.reset();  // at_power_s goes on: the motor has not cooled down
  seat.port = &port;
  port.seat_ = &seat;
  seat.settings.begin_again();
  seat.told_in_force.clear();
  seat.connected_at_robot_us = seat.next_sample_at_robot_us = hello.robot_time_us;
  seat.latch_known_at_robot_us = hello.robot_time_us;
  robot.link = LinkState::connected;
  robot.peer = peer;
  robot.connected_at_us = robot.last_received_at_us = hello.received_at_us;
  robot.last_received_steady_us = clock_.steady_us();
  robot.latest_robot_time_us = hello.robot_time_us;
  robot.boot_id = hello.boot_id;
  robot.reset_cause = hello.reset_cause;
  robot.firmware_version = hello.firmware_version;
  robot.sample_period_us = hello.sample_period_us;
  robot.ring_capacity = details.ring_capacity;
  robot.parameters_checksum = details.parameters_checksum;
  robot.controller_checksum = details.controller_checksum;
  if (other_boot) {
    robot.context = SampleContext{};
    robot.clock = ClockEstimate{};
    seat.clock_sync = ClockSync{};
    seat.clock_recorded = ClockRecord{};
    seat.schedules.clear();
    seat.unknown.clear();  // what the boot before knew of them is gone
    seat.timed_by.clear();
    seat.timed_until_robot_us = seat.drop_timed_id = 0;
  }
  robot.context.controller_id = details.controller_id;
  robot.context.mode = details.mode;
  robot.context.emergency_id = details.emergency_id;
  robot.context.emergency_cause = details.emergency_cause;
  robot.next_seq = other_boot ? details.next_seq : std::max(robot.next_seq, details.next_seq);
  robot.oldest_seq = details.oldest_seq;
  robot.durable_next_seq = admission.durable_next_seq;
  robot.durable_next_event_seq = admission.durable_next_event_seq;
  robot.status.reset();
  spdlog::info("robot '{}' connected from {}: boot {}, {} samples held, durable to {}", robot.id, peer, robot.boot_id,
               details.next_seq - details.oldest_seq, admission.durable_next_seq);

  // SAFETY: a stop that no robot has acknowledged goes first; a robot that lost its latch in a reset is latched again.
  if (const auto stop = seat.newest_stop(); stop != nullptr) {
    hand_stop_to(seat, *stop);
  } else if (was_latched && other_boot && details.emergency_id == 0) {
    CommandRequest request;
    request.robot_id = robot.id;
    request.action = rheonaut_Command_init_zero;
    request.action.which_action = rheonaut_Command_emergency_stop_tag;
    request.actor = "station:latch";
    const auto relatch = make_pending(request, robot);
    add_pending(seat, relatch);
    hand_stop_to(seat, *relatch);
    if (relatch->record.state == CommandState::queued) publish(relatch->record);
  }
  seat.drop_timed_because = "link_lost";  // as the robot drops it when it notices
  drop_timed(seat);
  note(robot, "connected", fmt::format("from {}", peer));
  publish(robot);
}

void Station::on_disconnected(RobotPort& port, const std::string& reason) {
  Seat* seat = seat_of(port);
  if (seat == nullptr) return;  // its place was taken
  seat->port = nullptr;
  port.seat_ = nullptr;
  RobotState& robot = *seat->robot;
  robot.link = LinkState::disconnected;
  spdlog::info("robot '{}' disconnected: {}", robot.id, reason);
  std::vector<CommandId> ended;
  for (const auto& [id, pending] : seat->commands) {
    if (!pending->is_stop()) ended.push_back(id);  // SAFETY: a stop is kept until a robot acknowledges it
  }
  for (const CommandId id : ended) {
    const bool was_sent = seat->commands.at(id)->record.state == CommandState::sent;
    was_sent ? end_without_answer(*seat, id, "link_lost") : finish(*seat, id, CommandState::failed, "link_lost");
  }
  end_unseen(*seat, "link_lost");
  note(robot, "disconnected", reason);
  publish(robot);
}

void Station::on_refused(const RobotId& id, const std::string& peer, protocol::RefusalReason reason,
                         const std::string& detail) {
  const auto found = seats_.find(id);
  if (found == seats_.end()) return;
  Seat& seat = found->second;
  const std::int64_t now_us = clock_.steady_us();
  if (seat.refusal_told_at_us != 0 && now_us - seat.refusal_told_at_us < kRefusalPeriodUs) {
    ++seat.refusals_untold;
    return;
  }
  seat.refusal_told_at_us = now_us;
  const std::uint64_t untold = std::exchange(seat.refusals_untold, 0);
  const std::string more = untold == 0 ? "" : fmt::format(" ({} more since the last event)", untold);
  const char* cause = protocol::text(reason);
  note(*seat.robot, "connection_refused", fmt::format("{} refused, {}: {}{}", peer, cause, detail, more), cause);
}

void Station::on_enrolment_refused(const RobotId& id, const std::string& peer, const std::string& detail) {
  const std::int64_t now_us = clock_.steady_us();
  if (enrolment_told_at_us_ != 0 && now_us - enrolment_told_at_us_ < kRefusalPeriodUs) {
    ++enrolments_untold_;
    return;
  }
  enrolment_told_at_us_ = now_us;
  const std::uint64_t untold = std::exchange(enrolments_untold_, 0);
  const std::string more = untold == 0 ? "" : fmt::format(" ({} more since the last event)", untold);
  spdlog::warn("robot '{}' from {} was not enrolled: {}{}", id, peer, detail, more);
  RobotState unknown;
  unknown.id = id;
  note(unknown, "enrolment_refused", fmt::format("{}: {}{}", peer, detail, more));
}

void Station::end_connection(const RobotId& id, const std::string& reason) {
  const auto seat = seats_.find(id);
  if (seat != seats_.end() && seat->second.port != nullptr) seat->second.port->close(reason);
}

void Station::on_frame(RobotPort& port, std::uint64_t robot_time_us) {
  Seat* seat = seat_of(port);
  if (seat == nullptr) return;
  RobotState& robot = *seat->robot;
  robot.last_received_at_us = clock_.utc_us();
  robot.last_received_steady_us = clock_.steady_us();
  robot.latest_robot_time_us = std::max(robot.latest_robot_time_us, robot_time_us);
  expire_commands(*seat);
  repeat_stop(*seat);
}

void Station::on_samples(RobotPort& port, const protocol::Telemetry& telemetry) {
  Seat* seat = seat_of(port);
  if (seat == nullptr) return;
  RobotState& robot = *seat->robot;
  SampleBatch& batch = batch_;
  batch.robot_id = robot.id;
  batch.boot_id = robot.boot_id;
  batch.first_seq = telemetry.first_seq;
  batch.first_robot_time_us = telemetry.first_robot_time_us;
  batch.oldest_seq = telemetry.oldest_seq;
  batch.context = context_of(telemetry);
  copy_samples(telemetry, batch.samples);
  batch.received_at_us = robot.last_received_at_us;
  const std::int64_t utc_minus_steady_us = robot.last_received_at_us - robot.last_received_steady_us;
  if (robot.clock.valid) {
    batch.utc_offset_us = robot.clock.offset_us + utc_minus_steady_us;
    const std::uint64_t last_time_us = batch.first_robot_time_us + (batch.samples.size() - 1) * telemetry.period_us;
    batch.clock_uncertainty_us =
        std::max(robot.clock.uncertainty_us(batch.first_robot_time_us), robot.clock.uncertainty_us(last_time_us));
  } else {
    batch.utc_offset_us = robot.last_received_at_us - static_cast<std::int64_t>(robot.latest_robot_time_us);
    batch.clock_uncertainty_us = -1;
  }
  if (batch.next_seq() > robot.next_seq) {  // live, not sent again
    const std::uint64_t emergency_id = robot.context.emergency_id;
    const auto emergency_cause = robot.context.emergency_cause;
    const bool new_controller = robot.context.controller_id != batch.context.controller_id;
    robot.context = batch.context;
    // SAFETY: a batch that was made before the latest ack of a stop or clear does not undo what that ack said.
    if (batch.first_robot_time_us < seat->latch_known_at_robot_us) {
      robot.context.emergency_id = emergency_id;
      robot.context.emergency_cause = emergency_cause;
    }
    robot.sample = batch.samples.back();
    count_power(robot, batch);
    robot.next_seq = batch.next_seq();
    seat->next_sample_at_robot_us = batch.first_robot_time_us + batch.samples.size() * telemetry.period_us;
    std::erase_if(seat->schedules,
                  [seat](const AcceptedSchedule& one) { return one.until_robot_us <= seat->next_sample_at_robot_us; });
    if (new_controller) publish(robot);
  }
  robot.oldest_seq = std::max(robot.oldest_seq, batch.oldest_seq);
  for (StationSink* sink : sinks_) sink->on_samples(robot, batch);
  if (!seat->unseen.empty()) look_for_commands(*seat, batch);
  // SAFETY: by now every acknowledgement has come of what the robot dropped together; what is left was judged wrongly.
  if (seat->begins_too_far_away(envelope_.in(robot.fluid))) seat->drop_timed_because = "step_too_large";
  if (seat->has_lost_a_step || seat->drop_timed_because != nullptr) drop_timed(*seat);
  if (!seat->commands.empty() || !seat->unknown.empty()) settle_by_samples(*seat, batch);
}

void Station::count_power(RobotState& robot, const SampleBatch& batch) const {
  const CommandLimits& limits = envelope_.in(robot.fluid);
  const double period_s = batch.context.period_us / 1e6;
  for (const Sample& sample : batch.samples) {
    const bool is_at_power = std::abs(sample.duty) > limits.power_duty;
    robot.at_power_s = std::max(robot.at_power_s + (is_at_power ? period_s : -period_s), 0.0);
  }
}

void Station::on_event(RobotPort& port, const protocol::Event& event) {
  Seat* seat = seat_of(port);
  if (seat == nullptr) return;
  const RobotState& robot = *seat->robot;
  RobotEvent out;
  out.robot_id = robot.id;
  out.boot_id = robot.boot_id;
  out.event_seq = event.event_seq;
  out.oldest_event_seq = event.oldest_event_seq;
  out.robot_time_us = event.event_robot_time_us;
  out.sample_seq = event.sample_seq;
  out.kind = protocol::text(event.kind);
  out.cause = protocol::text(event.cause);
  out.emergency_cause = event.emergency_cause;
  out.unknown_values = UnknownValues{}
                           .add("kind", event.kind)
                           .add("cause", event.cause)
                           .add("mode", event.mode)
                           .add("sub_state", event.sub_state)
                           .add("emergency_cause", event.emergency_cause)
                           .text();
  out.mode = event.mode;
  out.sub_state = event.sub_state;
  out.position_m = event.position_m;
  out.value = event.value;
  out.emergency_id = event.emergency_id;
  out.command_id = event.command_id;
  out.received_at_us = robot.last_received_at_us;
  for (StationSink* sink : sinks_) sink->on_event(robot, out);
  seat->note_event(event);
  settle_by_event(*seat, event);
}

void Station::on_invalid_values(RobotPort& port, std::uint64_t count, const char* cause, const std::string& first) {
  Seat* seat = seat_of(port);
  if (seat == nullptr) return;
  invalid_values_ += count;
  seat->robot->invalid_values += count;
  const std::int64_t now_us = clock_.steady_us();
  if (seat->invalid_told_at_us != 0 && now_us - seat->invalid_told_at_us < kInvalidPeriodUs) {
    seat->invalid_untold += count;
    return;
  }
  seat->invalid_told_at_us = now_us;
  const std::uint64_t more = std::exchange(seat->invalid_untold, 0) + count - 1;
  std::string detail = first;
  if (more > 0) detail += fmt::format(" ({} more since the last event)", more);
  spdlog::warn("robot '{}' sends what cannot be: {}", seat->robot->id, detail);
  note(*seat->robot, "invalid_value", std::move(detail), cause);
}

void Station::on_unusable_samples(RobotPort& port, const protocol::Telemetry& telemetry) {
  const Seat* seat = seat_of(port);
  if (seat == nullptr) return;
  const std::uint64_t next_seq = telemetry.first_seq + telemetry.position_m_count;
  for (StationSink* sink : sinks_) sink->on_unusable_samples(*seat->robot, telemetry.first_seq, next_seq);
}

void Station::on_unusable_event(RobotPort& port, const protocol::Event& event) {
  const Seat* seat = seat_of(port);
  if (seat == nullptr) return;
  for (StationSink* sink : sinks_) sink->on_unusable_event(*seat->robot, event.event_seq);
}

void Station::on_status(RobotPort& port, const protocol::Status& status) {
  Seat* seat = seat_of(port);
  if (seat == nullptr) return;
  RobotState& robot = *seat->robot;
  robot.status = status;
  publish(robot);
}

void Station::on_durable(const RobotId& id, BootId boot_id, std::uint64_t durable_next_seq,
                         std::uint64_t durable_next_event_seq) {
  const auto robot = robots_.find(id);
  if (robot == robots_.end() || robot->second.boot_id != boot_id) return;
  robot->second.durable_next_seq = durable_next_seq;
  robot->second.durable_next_event_seq = durable_next_event_seq;
  if (RobotPort* port = seats_.at(id).port; port != nullptr)
    port->acknowledge(durable_next_seq, durable_next_event_seq);
}

void Station::request_resend(const RobotId& id, BootId boot_id, std::uint64_t first_seq, std::uint64_t next_seq) {
  const auto robot = robots_.find(id);
  if (robot == robots_.end() || robot->second.boot_id != boot_id) return;
  if (RobotPort* port = seats_.at(id).port; port != nullptr) port->request_resend(first_seq, next_seq);
}

void Station::request_event_resend(const RobotId& id, BootId boot_id) {
  const auto robot = robots_.find(id);
  if (robot == robots_.end() || robot->second.boot_id != boot_id) return;
  if (RobotPort* port = seats_.at(id).port; port != nullptr) port->request_event_resend();
}

}  // namespace server
