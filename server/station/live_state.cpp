#include "server/station/live_state.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>

#include "server/station/state/telemetry_fields.hpp"
#include "server/station/state/unknown_values.hpp"

namespace server::station {
namespace {

void begin_boot(RobotEntry& entry) {
  entry.robot.context = SampleContext{};
  entry.robot.clock = ClockEstimate{};
  entry.reported.begin_boot();
  entry.orders.clear();
  entry.next_event_seq = 0;
  entry.commands.unknown.clear();  // what the boot before knew of them is gone
  entry.timed.by = {};
  entry.timed.until_robot_us = entry.timed.drop_id = 0;
  entry.timed.is_of_earlier_run = false;
}

void show_hello(RobotState& robot, const AdmissionRequest& hello, const protocol::Hello& details,
                const Admission& admission, bool is_other_boot) {
  robot.boot_id = hello.boot_id;
  robot.reset_cause = hello.reset_cause;
  robot.firmware_version = hello.firmware_version;
  robot.sample_period_us = hello.sample_period_us;
  robot.ring_capacity = details.ring_capacity;
  robot.parameters_checksum = details.parameters_checksum;
  robot.controller_checksum = details.controller_checksum;
  robot.context.controller_id = details.controller_id;
  robot.context.mode = details.mode;
  robot.context.emergency_id = details.emergency_id;
  robot.context.emergency_cause = details.emergency_cause;
  robot.next_seq = is_other_boot ? details.next_seq : std::max(robot.next_seq, details.next_seq);
  robot.oldest_seq = details.oldest_seq;
  robot.durable_next_seq = admission.durable_next_seq;
  robot.durable_next_event_seq = admission.durable_next_event_seq;
  robot.status.reset();
}

void count_power(RobotState& robot, const SampleBatch& batch, const config::CommandLimits& limits) {
  const double period_s = batch.context.period_us / 1e6;
  for (const Sample& sample : batch.samples) {
    const bool is_at_power = std::abs(sample.duty) > limits.power_duty;
    robot.at_power_s = std::max(robot.at_power_s + (is_at_power ? period_s : -period_s), 0.0);
  }
}

}  // namespace

void begin_connection(RobotEntry& entry, const AdmissionRequest& hello, const protocol::Hello& details,
                      const Admission& admission, const std::string& peer, std::int64_t now_steady_us) {
  RobotState& robot = entry.robot;
  const bool is_other_boot = robot.boot_id != hello.boot_id;
  if (is_other_boot) robot.sample.reset();  // at_power_s goes on: the motor has not cooled down
  entry.reported.begin_connection();
  entry.orders.begin_connection(hello.robot_time_us);
  entry.connected_at_robot_us = entry.latch_known_at_robot_us = hello.robot_time_us;
  robot.link = LinkState::connected;
  robot.peer = peer;
  robot.connected_at_us = robot.last_received_at_us = hello.received_at_us;
  robot.last_received_steady_us = now_steady_us;
  robot.latest_robot_time_us = hello.robot_time_us;
  robot.stop_path = {.is_measured = details.answers_stop_probes};
  if (is_other_boot) begin_boot(entry);
  entry.next_event_seq = std::max(entry.next_event_seq, admission.durable_next_event_seq);
  show_hello(robot, hello, details, admission, is_other_boot);
}

void fill_batch(const RobotState& robot, Checked<protocol::Telemetry> checked, SampleBatch& batch) {
  const protocol::Telemetry& telemetry = *checked;
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
}

bool show_samples(RobotEntry& entry, const SampleBatch& batch, const config::CommandLimits& limits) {
  RobotState& robot = entry.robot;
  if (batch.next_seq() <= robot.next_seq) return false;  // sent again
  const std::uint64_t emergency_id = robot.context.emergency_id;
  const auto emergency_cause = robot.context.emergency_cause;
  const bool is_new_controller = robot.context.controller_id != batch.context.controller_id;
  robot.context = batch.context;
  // SAFETY: a batch that was made before the latest ack of a stop or clear does not undo what that ack said.
  if (batch.first_robot_time_us < entry.latch_known_at_robot_us) {
    robot.context.emergency_id = emergency_id;
    robot.context.emergency_cause = emergency_cause;
  }
  robot.sample = batch.samples.back();
  count_power(robot, batch, limits);
  robot.next_seq = batch.next_seq();
  entry.orders.note_samples(batch.first_robot_time_us + batch.samples.size() * batch.context.period_us);
  return is_new_controller;
}

RobotEvent event_of(const RobotState& robot, Checked<protocol::Event> checked) {
  const protocol::Event& event = *checked;
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
  return out;
}

}  // namespace server::station
