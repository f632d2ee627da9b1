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

// As much as there is room for, cut between two characters of UTF-8.
template <std::size_t size>
void cut_text(std::array<char, size>& to, const char* from) {
  std::strncpy(to.data(), from, size);
  std::size_t end = size - 1;
  while (end > 0 && (static_cast<unsigned char>(to[end]) & 0xC0U) == 0x80U) --end;
  to[end] = '\0';
}

}  // namespace

void Robot::link_opened(std::uint64_t now_us) {
  now_us_ = std::max(now_us_, now_us);
  refusal_ = rheonaut_REFUSAL_REASON_NONE;
  refusal_detail_[0] = '\0';
  link_.opened(now_us_);
  outbox_.opened();
}

void Robot::link_closed(std::uint64_t now_us) {
  now_us_ = std::max(now_us_, now_us);
  link_.closed();
}

bool Robot::receive(protocol::Bytes bytes, std::uint64_t now_us) {
  now_us_ = std::max(now_us_, now_us);
  if (link_.phase() == Link::Phase::closed) return false;
  while (!bytes.empty()) {
    switch (link_.reader.push(bytes)) {
      case protocol::FrameReader::State::incomplete: break;
      case protocol::FrameReader::State::oversize: ++bad_frames_; return false;
      case protocol::FrameReader::State::complete:
        if (!on_frame(link_.reader.payload())) return false;
    }
  }
  return true;
}

bool Robot::on_frame(protocol::Bytes payload) {
  const auto frame = protocol::decode_station_frame(payload);
  if (!frame) {
    ++bad_frames_;
    return false;
  }
  if (link_.up()) station_heard();
  if (frame->which_body == rheonaut_StationFrame_command_tag) ++commands_received_;
  if (frame->which_body == rheonaut_StationFrame_command_tag &&
      frame->body.command.which_action == rheonaut_Command_emergency_stop_tag) {
    on_emergency_stop(frame->body.command);  // SAFETY: a stop is obeyed before any Welcome
    return true;
  }
  // Before its Welcome a station says nothing else, and it welcomes once.
  const bool is_welcome = frame->which_body == rheonaut_StationFrame_welcome_tag;
  if (is_welcome == link_.up()) return false;
  if (is_welcome) return on_welcome(frame->body.welcome);
  if (frame->which_body == rheonaut_StationFrame_heartbeat_tag) on_heartbeat(frame->body.heartbeat);
  if (frame->which_body == rheonaut_StationFrame_command_tag) on_command(frame->body.command);
  return true;
}

bool Robot::on_welcome(const protocol::Welcome& welcome) {
  refusal_ = welcome.refusal;
  if (refusal_ == rheonaut_REFUSAL_REASON_NONE && welcome.protocol_version != protocol::kProtocolVersion) {
    refusal_ = rheonaut_REFUSAL_REASON_VERSION;
  }
  cut_text(refusal_detail_, welcome.detail);
  if (refusal_ != rheonaut_REFUSAL_REASON_NONE) return false;
  link_.welcomed(welcome, saturated<std::uint32_t>(parameters_[ParameterId::link_timeout_ms]), now_us_);
  station_heard();
  samples_.acknowledge(welcome.durable_next_seq);
  events_.acknowledge(welcome.durable_next_event_seq);
  outbox_.welcomed(samples_, events_);
  return true;
}

void Robot::station_heard() {
  const auto silence_s = link_.heard(now_us_);
  if (silence_s) pilot_.link_restored();
  if (silence_s) note(rheonaut_EVENT_KIND_LINK_RESTORED, rheonaut_EVENT_CAUSE_NONE, *silence_s);
}

void Robot::on_heartbeat(const protocol::StationHeartbeat& heartbeat) {
  samples_.acknowledge(heartbeat.durable_next_seq);
  events_.acknowledge(heartbeat.durable_next_event_seq);
  outbox_.resend(heartbeat.resend_first_seq, heartbeat.resend_next_seq);
  if (heartbeat.resend_events) outbox_.resend_events(events_);
  if (heartbeat.station_time_us != 0) outbox_.echo(heartbeat.station_time_us, now_us_);
}

std::size_t Robot::transmit(std::uint8_t* out, std::size_t capacity, std::uint64_t now_us) {
  now_us_ = std::max(now_us_, now_us);
  const Outgoing what =
      outbox_.next(link_, samples_, events_, link_.samples_per_frame(config_.samples_per_frame), now_us_);
  if (what == Outgoing::none) return 0;
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.robot_time_us = now_us_;
  fill(what, frame);
  const std::size_t size = protocol::write_frame(frame, out, capacity);
  if (size == 0) return 0;
  const bool telemetry = frame.which_body == rheonaut_RobotFrame_telemetry_tag;
  outbox_.sent(what, telemetry ? frame.body.telemetry.position_m_count : 0, now_us_);
  link_.sent(now_us_);
  if (what == Outgoing::status) worst_tick_us_ = 0;
  return size;
}

void Robot::fill(Outgoing what, protocol::RobotFrame& frame) const {
  switch (what) {
    case Outgoing::none: return;
    case Outgoing::hello: frame.which_body = rheonaut_RobotFrame_hello_tag; return fill_hello(frame.body.hello);
    case Outgoing::ack:
      frame.which_body = rheonaut_RobotFrame_command_ack_tag;
      frame.body.command_ack = outbox_.first_ack();
      return;
    case Outgoing::parameters:
      frame.which_body = rheonaut_RobotFrame_parameter_page_tag;
      return fill_parameters(outbox_.first_page(), frame.body.parameter_page);
    case Outgoing::controller:
      frame.which_body = rheonaut_RobotFrame_controller_tag;
      return write_controller(controllers_.in_force(), config_.sample_period_us, frame.body.controller);
    case Outgoing::event:
      frame.which_body = rheonaut_RobotFrame_event_tag;
      frame.body.event = events_.at(outbox_.event_seq());
      return;
    case Outgoing::live:
      frame.which_body = rheonaut_RobotFrame_telemetry_tag;
      return samples_.read(outbox_.live_seq(), link_.samples_per_frame(config_.samples_per_frame),
                           frame.body.telemetry);
    case Outgoing::status: frame.which_body = rheonaut_RobotFrame_status_tag; return fill_status(frame.body.status);
    case Outgoing::heartbeat:
      frame.which_body = rheonaut_RobotFrame_heartbeat_tag;
      frame.body.heartbeat = outbox_.heartbeat();
      return;
    case Outgoing::table:
      frame.which_body = rheonaut_RobotFrame_parameter_page_tag;
      return fill_parameters(outbox_.table_page(), frame.body.parameter_page);
    case Outgoing::backfill: {
      const SampleRun& run = outbox_.backfill();
      frame.which_body = rheonaut_RobotFrame_telemetry_tag;
      samples_.read(run.next_seq, static_cast<std::size_t>(run.end_seq - run.next_seq), frame.body.telemetry);
      frame.body.telemetry.flags |= rheonaut_TELEMETRY_FLAG_BACKFILL;
    }
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
    parameter.value = parameters_.value(request.first_index + i);
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
  hello.oldest_seq = samples_.oldest_seq();
  hello.next_seq = samples_.next_seq();
  hello.oldest_event_seq = events_.oldest_seq();
  hello.next_event_seq = events_.next_seq();
  hello.acknowledged_next_seq = samples_.acknowledged_next_seq();
  hello.acknowledged_next_event_seq = events_.acknowledged_next_seq();
  hello.parameters_checksum = parameters_.checksum();
  hello.controller_id = controllers_.in_force().controller_id;
  hello.controller_checksum = controllers_.in_force().checksum;
  hello.mode = mode();
  hello.emergency_id = safety_.emergency_id();
  hello.emergency_cause = safety_.cause();
}

void Robot::fill_status(protocol::Status& status) const {
  status.supply_mv = inputs_.supply_mv;
  status.rssi_dbm = inputs_.rssi_dbm;
  status.free_memory_bytes = inputs_.free_memory_bytes;
  status.worst_tick_us = worst_tick_us_;
  status.missed_ticks = inputs_.missed_ticks;
  status.ring_fill = samples_.fill();
  status.imu_calibration = inputs_.imu_calibration;
  status.bad_frames = bad_frames_;
  status.lost_samples = samples_.lost();
  status.lost_events = events_.lost();
}

}  // namespace robot_fw
