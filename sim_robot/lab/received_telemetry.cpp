#include "sim_robot/lab/received_telemetry.hpp"

#include <utility>

namespace sim_robot {
namespace {

constexpr std::uint64_t kCommandLifeUs = 2'000'000;

}  // namespace

bool ReceivedTelemetry::take(protocol::Bytes bytes) {
  while (!bytes.empty()) {
    switch (reader_.push(bytes)) {
      case protocol::FrameReader::State::incomplete: break;
      case protocol::FrameReader::State::oversize: return false;
      case protocol::FrameReader::State::complete: {
        const auto frame = protocol::decode_robot_frame(reader_.payload());
        if (!frame) return false;
        on_frame(*frame);
      }
    }
  }
  return true;
}

void ReceivedTelemetry::on_frame(const protocol::RobotFrame& frame) {
  frames.push_back(frame);
  switch (frame.which_body) {
    case rheonaut_RobotFrame_hello_tag: on_hello(frame.body.hello); break;
    case rheonaut_RobotFrame_command_ack_tag: acks.push_back(frame.body.command_ack); break;
    case rheonaut_RobotFrame_event_tag: events.push_back(frame.body.event); break;
    case rheonaut_RobotFrame_parameter_page_tag:
      (frame.body.parameter_page.command_id == 0 ? table : pages).push_back(frame.body.parameter_page);
      break;
    case rheonaut_RobotFrame_controller_tag: controllers.push_back(frame.body.controller); break;
    case rheonaut_RobotFrame_telemetry_tag: on_telemetry(frame.body.telemetry); break;
    default: break;
  }
}

void ReceivedTelemetry::on_hello(const protocol::Hello& frame) {
  hello = frame;
  if (frame.boot_id == boot_id_) return;
  if (boot_id_ != 0) earlier_boots.push_back(std::exchange(samples, {}));
  boot_id_ = frame.boot_id;
  earlier_events_ = events.size();
  durable_next_seq_ = lost_samples_ = 0;
}

void ReceivedTelemetry::on_telemetry(const protocol::Telemetry& batch) {
  for (pb_size_t i = 0; i < batch.position_m_count; ++i) {
    ReceivedSample sample;
    sample.robot_time_us = batch.first_robot_time_us + std::uint64_t{i} * batch.period_us;
    sample.position_m = batch.position_m[i];
    sample.velocity_m_s = batch.velocity_m_s[i];
    sample.acceleration_m_s2 = batch.acceleration_m_s2[i];
    sample.duty = batch.duty[i];
    sample.impedance_mv = batch.impedance_mv[i];
    sample.reference_m = batch.reference_m[i];
    sample.mode = batch.mode;
    sample.sub_state = batch.sub_state;
    sample.position_sd_m = batch.position_sd_m;
    if (batch.has_setpoint_m) sample.setpoint_m = batch.setpoint_m;
    sample.disturbance_m = batch.disturbance_m;
    sample.emergency_id = batch.emergency_id;
    sample.flags = batch.flags;
    sample.controller_id = batch.controller_id;
    samples[batch.first_seq + i] = sample;
  }
  for (;; ++durable_next_seq_) {
    if (samples.contains(durable_next_seq_)) continue;
    if (durable_next_seq_ >= batch.oldest_seq) break;
    ++lost_samples_;
  }
}

std::uint64_t ReceivedTelemetry::durable_next_event_seq() const {
  return events.size() > earlier_events_ ? events.back().event_seq + 1 : 0;
}

protocol::StationFrame ReceivedTelemetry::welcome_frame() const {
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_welcome_tag;
  frame.body.welcome = welcome;
  frame.body.welcome.protocol_version = protocol::kProtocolVersion;
  frame.body.welcome.durable_next_seq = durable_next_seq();
  frame.body.welcome.durable_next_event_seq = durable_next_event_seq();
  return frame;
}

protocol::StationFrame ReceivedTelemetry::heartbeat_frame(protocol::StationHeartbeat heartbeat) const {
  if (keeps_samples) {
    heartbeat.durable_next_seq = durable_next_seq();
    heartbeat.durable_next_event_seq = durable_next_event_seq();
  }
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_heartbeat_tag;
  frame.body.heartbeat = heartbeat;
  return frame;
}

protocol::Command ReceivedTelemetry::completed(protocol::Command command, std::uint64_t boot_id,
                                               std::uint64_t robot_time_us) {
  if (command.command_id == 0) command.command_id = next_command_id_++;
  if (command.boot_id == 0) command.boot_id = boot_id;
  if (command.valid_until_robot_us == 0) command.valid_until_robot_us = robot_time_us + kCommandLifeUs;
  return command;
}

std::optional<protocol::CommandAck> ReceivedTelemetry::ack_of(std::uint64_t command_id) const {
  for (auto ack = acks.rbegin(); ack != acks.rend(); ++ack) {
    if (ack->command_id == command_id) return *ack;
  }
  return std::nullopt;
}

}  // namespace sim_robot
