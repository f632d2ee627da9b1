// Frames in from the station and out to it.
#include <algorithm>
#include <cstring>

#include "robot_fw/core/controller_message.hpp"
#include "robot_fw/core/robot.hpp"
#include "robot_fw/core/saturate.hpp"

namespace robot_fw {
namespace {

template <std::size_t size>
void copy_text(char (&to)[size], const char* from) {
  std::strncpy(to, from, size - 1);
  to[size - 1] = '\0';
}

}  // namespace

void Robot::link_opened(std::uint64_t now_us) {
  now_us_ = std::max(now_us_, now_us);
  channel_.opened(now_us_);
}

void Robot::link_closed(std::uint64_t now_us) {
  now_us_ = std::max(now_us_, now_us);
  channel_.closed();
}

bool Robot::receive(protocol::Bytes bytes, std::uint64_t now_us) {
  now_us_ = std::max(now_us_, now_us);
  if (channel_.link().phase() == Link::Phase::closed) return false;
  while (!bytes.empty()) {
    switch (channel_.push(bytes)) {
      case protocol::FrameReader::State::incomplete: break;
      case protocol::FrameReader::State::oversize: return false;
      case protocol::FrameReader::State::complete:
        if (!on_frame()) return false;
    }
  }
  return true;
}

bool Robot::on_frame() {
  const auto frame = channel_.frame();
  if (!frame) return false;
  const bool is_up = channel_.link().up();
  if (is_up) on_station_frame();
  const bool is_command = frame->which_body == rheonaut_StationFrame_command_tag;
  if (is_command && frame->body.command.which_action == rheonaut_Command_emergency_stop_tag) {
    on_emergency_stop(frame->body.command);  // SAFETY: a stop is obeyed before any Welcome
    return true;
  }
  // Before its Welcome a station says nothing else, and it welcomes once.
  const bool is_welcome = frame->which_body == rheonaut_StationFrame_welcome_tag;
  if (is_welcome == is_up) return false;
  if (is_welcome) return on_welcome(frame->body.welcome);
  if (frame->which_body == rheonaut_StationFrame_heartbeat_tag) channel_.on_heartbeat(frame->body.heartbeat, now_us_);
  if (frame->which_body == rheonaut_StationFrame_stop_probe_tag) {
    channel_.outbox().answer_stop_probe(frame->body.stop_probe.station_time_us);
  }
  if (is_command) on_command(frame->body.command);
  return true;
}

bool Robot::on_welcome(const protocol::Welcome& welcome) {
  const auto timeout_ms = saturated<std::uint32_t>(settings_.parameters()[ParameterId::link_timeout_ms]);
  if (!channel_.accept(welcome, timeout_ms, now_us_)) return false;
  on_station_frame();
  channel_.resume(welcome);
  return true;
}

void Robot::on_station_frame() {
  const auto silence_s = channel_.frame_received(now_us_);
  if (silence_s) pilot_.link_restored();
  if (silence_s) note(rheonaut_EVENT_KIND_LINK_RESTORED, rheonaut_EVENT_CAUSE_NONE, *silence_s);
}

std::size_t Robot::transmit(std::uint8_t* out, std::size_t capacity, std::uint64_t now_us) {
  now_us_ = std::max(now_us_, now_us);
  const Outgoing what = channel_.next(now_us_);
  if (what == Outgoing::none) return 0;
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.robot_time_us = now_us_;
  fill(what, frame);
  const std::size_t size = protocol::write_frame(frame, out, capacity);
  if (size == 0) return 0;
  const bool is_telemetry = frame.which_body == rheonaut_RobotFrame_telemetry_tag;
  channel_.sent(what, is_telemetry ? frame.body.telemetry.position_m_count : 0, now_us_);
  if (what == Outgoing::status) worst_tick_us_ = 0;
  return size;
}

void Robot::fill(Outgoing what, protocol::RobotFrame& frame) const {
  switch (what) {
    case Outgoing::hello: frame.which_body = rheonaut_RobotFrame_hello_tag; return fill_hello(frame.body.hello);
    case Outgoing::parameters:
      frame.which_body = rheonaut_RobotFrame_parameter_page_tag;
      return fill_parameters(channel_.outbox().first_page(), frame.body.parameter_page);
    case Outgoing::table:
      frame.which_body = rheonaut_RobotFrame_parameter_page_tag;
      return fill_parameters(channel_.outbox().table_page(), frame.body.parameter_page);
    case Outgoing::controller:
      frame.which_body = rheonaut_RobotFrame_controller_tag;
      return write_controller(settings_.controllers().in_force(), config_.sample_period_us, frame.body.controller);
    case Outgoing::status: frame.which_body = rheonaut_RobotFrame_status_tag; return fill_status(frame.body.status);
    default: return channel_.fill(what, frame);
  }
}

void Robot::fill_parameters(const PageRequest& request, protocol::ParameterPage& page) const {
  page.command_id = request.command_id;
  page.first_index = static_cast<std::uint32_t>(request.first_index);
  page.total = kParameterCount;
  page.parameters_count = static_cast<pb_size_t>(request.count);
  for (std::size_t i = 0; i < request.count; ++i) {
    const ParameterSpec& spec = Parameters::spec(request.first_index + i);
    rheonaut_Parameter& parameter = page.parameters[i];
    copy_text(parameter.name, spec.name);
    copy_text(parameter.unit, spec.unit);
    parameter.value = settings_.parameters().value(request.first_index + i);
    parameter.minimum = spec.minimum;
    parameter.maximum = spec.maximum;
    parameter.default_value = spec.default_value;
  }
}

void Robot::fill_hello(protocol::Hello& hello) const {
  hello.protocol_version = protocol::kProtocolVersion;
  copy_text(hello.robot_id, config_.robot_id);
  copy_text(hello.token, config_.token);
  copy_text(hello.firmware_version, config_.firmware_version);
  hello.boot_id = config_.boot_id;
  hello.reset_cause = config_.reset_cause;
  hello.sample_period_us = config_.sample_period_us;
  hello.ring_capacity = TelemetryRing::kCapacity;
  hello.oldest_seq = channel_.samples().oldest_seq();
  hello.next_seq = channel_.samples().next_seq();
  hello.oldest_event_seq = channel_.events().oldest_seq();
  hello.next_event_seq = channel_.events().next_seq();
  hello.acknowledged_next_seq = channel_.samples().acknowledged_next_seq();
  hello.acknowledged_next_event_seq = channel_.events().acknowledged_next_seq();
  hello.parameters_checksum = settings_.parameters().checksum();
  const ControllerSections& controller = settings_.controllers().in_force();
  hello.controller_id = controller.controller_id;
  hello.controller_checksum = controller.checksum;
  hello.mode = mode();
  hello.emergency_id = safety_.emergency_id();
  hello.emergency_cause = safety_.cause();
  hello.answers_stop_probes = true;
}

void Robot::fill_status(protocol::Status& status) const {
  status.supply_mv = inputs_.supply_mv;
  status.rssi_dbm = inputs_.rssi_dbm;
  status.free_memory_bytes = inputs_.free_memory_bytes;
  status.worst_tick_us = worst_tick_us_;
  status.missed_ticks = inputs_.missed_ticks;
  status.ring_fill = channel_.samples().fill();
  status.imu_calibration = inputs_.imu_calibration;
  status.bad_frames = channel_.bad_frames();
  status.lost_samples = channel_.samples().lost();
  status.lost_events = channel_.events().lost();
}

}  // namespace robot_fw
