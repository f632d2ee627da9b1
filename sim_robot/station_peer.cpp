// Speaks the station's half of the protocol.
#include "sim_robot/station_peer.hpp"

#include <array>
#include <cstring>

namespace sim_robot {
namespace {

constexpr std::uint64_t kCommandLifeUs = 2'000'000;

protocol::Command command_of(pb_size_t action) {
  protocol::Command command = rheonaut_Command_init_zero;
  command.which_action = action;
  return command;
}

}  // namespace

protocol::Command set_auto(float setpoint_m) {
  protocol::Command command = command_of(rheonaut_Command_set_mode_tag);
  command.action.set_mode = {rheonaut_MODE_AUTO, true, setpoint_m};
  return command;
}

protocol::Command set_manual() {
  protocol::Command command = command_of(rheonaut_Command_set_mode_tag);
  command.action.set_mode.mode = rheonaut_MODE_MANUAL;
  return command;
}

protocol::Command set_setpoint(float setpoint_m) {
  protocol::Command command = command_of(rheonaut_Command_set_setpoint_tag);
  command.action.set_setpoint.setpoint_m = setpoint_m;
  return command;
}

protocol::Command set_duty(float duty, std::uint32_t lease_ms) {
  protocol::Command command = command_of(rheonaut_Command_set_duty_tag);
  command.action.set_duty = {duty, lease_ms};
  return command;
}

protocol::Command renew_lease() { return command_of(rheonaut_Command_renew_lease_tag); }

protocol::Command emergency_stop() { return command_of(rheonaut_Command_emergency_stop_tag); }

protocol::Command clear_emergency(std::uint64_t emergency_id) {
  protocol::Command command = command_of(rheonaut_Command_clear_emergency_tag);
  command.action.clear_emergency.emergency_id = emergency_id;
  return command;
}

protocol::Command inject_disturbance(float disturbance_m) {
  protocol::Command command = command_of(rheonaut_Command_inject_disturbance_tag);
  command.action.inject_disturbance.disturbance_m = disturbance_m;
  return command;
}

protocol::Command zero_position() { return command_of(rheonaut_Command_zero_position_tag); }

protocol::Command ping() { return command_of(rheonaut_Command_ping_tag); }

protocol::Command set_controller(const protocol::Controller& controller) {
  protocol::Command command = command_of(rheonaut_Command_set_controller_tag);
  command.action.set_controller = controller;
  return command;
}

protocol::Command restore_controller() { return command_of(rheonaut_Command_restore_controller_tag); }

protocol::Command set_parameter(const char* name, float value) {
  protocol::Command command = command_of(rheonaut_Command_set_parameter_tag);
  auto& order = command.action.set_parameter;
  std::strncpy(order.name, name, sizeof(order.name) - 1);
  order.value = value;
  return command;
}

protocol::Command get_parameters(std::uint32_t first_index) {
  protocol::Command command = command_of(rheonaut_Command_get_parameters_tag);
  command.action.get_parameters.first_index = first_index;
  return command;
}

void StationPeer::connect() {
  robot_.link_opened(robot_.robot_time_us());
  connected_ = true;
  hello.reset();
  listen();
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_welcome_tag;
  frame.body.welcome = welcome;
  frame.body.welcome.protocol_version = protocol::kProtocolVersion;
  frame.body.welcome.durable_next_seq = durable_next_seq();
  frame.body.welcome.durable_next_event_seq = durable_next_event_seq();
  send(frame);
}

void StationPeer::disconnect() {
  robot_.link_closed(robot_.robot_time_us());
  connected_ = false;
}

void StationPeer::run(int ticks) {
  for (int i = 0; i < ticks; ++i) step();
}

void StationPeer::step() {
  robot_.step();
  if (!connected_) return;
  listen();
  if (attentive) send_heartbeat(rheonaut_StationHeartbeat_init_zero);
}

void StationPeer::listen() {
  std::array<std::uint8_t, protocol::kMaxFramedBytes> buffer;
  protocol::FrameReader reader;
  while (const std::size_t size = robot_.transmit(buffer.data(), buffer.size(), robot_.robot_time_us())) {
    protocol::Bytes bytes{buffer.data(), size};
    if (reader.push(bytes) != protocol::FrameReader::State::complete) return;
    if (const auto frame = protocol::decode_robot_frame(reader.payload())) on_frame(*frame);
  }
}

void StationPeer::on_frame(const protocol::RobotFrame& frame) {
  frames.push_back(frame);
  switch (frame.which_body) {
    case rheonaut_RobotFrame_hello_tag: hello = frame.body.hello; break;
    case rheonaut_RobotFrame_command_ack_tag: acks.push_back(frame.body.command_ack); break;
    case rheonaut_RobotFrame_event_tag: events.push_back(frame.body.event); break;
    case rheonaut_RobotFrame_parameter_page_tag: pages.push_back(frame.body.parameter_page); break;
    case rheonaut_RobotFrame_controller_tag: controllers.push_back(frame.body.controller); break;
    case rheonaut_RobotFrame_telemetry_tag: {
      const protocol::Telemetry& batch = frame.body.telemetry;
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
      break;
    }
    default: break;
  }
}

std::uint64_t StationPeer::send(protocol::Command command) {
  if (command.command_id == 0) command.command_id = next_command_id_++;
  if (command.boot_id == 0) command.boot_id = robot_.config().boot_id;
  if (command.valid_until_robot_us == 0) command.valid_until_robot_us = robot_.robot_time_us() + kCommandLifeUs;
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_command_tag;
  frame.body.command = command;
  send(frame);
  return command.command_id;
}

bool StationPeer::send(const protocol::StationFrame& frame) {
  std::array<std::uint8_t, protocol::kMaxFramedBytes> buffer;
  const std::size_t size = protocol::write_frame(frame, buffer.data(), buffer.size());
  return robot_.receive({buffer.data(), size}, robot_.robot_time_us());
}

bool StationPeer::send_heartbeat(protocol::StationHeartbeat heartbeat) {
  if (keeps_samples) {
    heartbeat.durable_next_seq = durable_next_seq();
    heartbeat.durable_next_event_seq = durable_next_event_seq();
  }
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_heartbeat_tag;
  frame.body.heartbeat = heartbeat;
  return send(frame);
}

std::optional<protocol::CommandAck> StationPeer::ack_of(std::uint64_t command_id) const {
  for (auto ack = acks.rbegin(); ack != acks.rend(); ++ack) {
    if (ack->command_id == command_id) return *ack;
  }
  return std::nullopt;
}

// The end of the samples without a hole from the first one on.
std::uint64_t StationPeer::durable_next_seq() const {
  std::uint64_t next = 0;
  if (!samples.empty()) {
    next = samples.rbegin()->first + 1;
    if (next == samples.size()) return next;  // no hole at all
    next = 0;
    for (const auto& [seq, sample] : samples) {
      if (seq != next) break;
      ++next;
    }
  }
  return next;
}

std::uint64_t StationPeer::durable_next_event_seq() const { return events.empty() ? 0 : events.back().event_seq + 1; }

}  // namespace sim_robot
