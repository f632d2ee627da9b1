// Takes frames in and fills those that go out.
#include "robot_fw/core/station_channel.hpp"

#include <cstring>

namespace robot_fw {
namespace {

// As much as there is room for, cut between two characters of UTF-8.
template <std::size_t size>
void cut_text(std::array<char, size>& to, const char* from) {
  std::strncpy(to.data(), from, size);
  std::size_t end = size - 1;
  while (end > 0 && (static_cast<unsigned char>(to[end]) & 0xC0U) == 0x80U) --end;
  to[end] = '\0';
}

}  // namespace

std::optional<protocol::StationFrame> StationChannel::frame() {
  auto frame = protocol::decode_station_frame(link_.payload());
  if (!frame) {
    ++bad_frames_;
  } else if (frame->which_body == rheonaut_StationFrame_command_tag) {
    ++commands_received_;
  }
  return frame;
}

bool StationChannel::accept(const protocol::Welcome& welcome, std::uint32_t default_timeout_ms, std::uint64_t now_us) {
  refusal_ = welcome.refusal;
  if (refusal_ == rheonaut_REFUSAL_REASON_NONE && welcome.protocol_version != protocol::kProtocolVersion) {
    refusal_ = rheonaut_REFUSAL_REASON_VERSION;
  }
  cut_text(refusal_detail_, welcome.detail);
  if (refusal_ != rheonaut_REFUSAL_REASON_NONE) return false;
  link_.welcomed(welcome, default_timeout_ms, now_us);
  return true;
}

void StationChannel::on_heartbeat(const protocol::StationHeartbeat& heartbeat, std::uint64_t now_us) {
  samples_.acknowledge(heartbeat.durable_next_seq);
  events_.acknowledge(heartbeat.durable_next_event_seq);
  outbox_.resend(heartbeat.resend_first_seq, heartbeat.resend_next_seq);
  if (heartbeat.resend_events) outbox_.resend_events(events_);
  if (heartbeat.station_time_us != 0) outbox_.echo(heartbeat.station_time_us, now_us);
}

void StationChannel::fill(Outgoing what, protocol::RobotFrame& frame) const {
  if (what == Outgoing::ack) {
    frame.which_body = rheonaut_RobotFrame_command_ack_tag;
    frame.body.command_ack = outbox_.first_ack();
  } else if (what == Outgoing::stop_probe_answer) {
    frame.which_body = rheonaut_RobotFrame_stop_probe_answer_tag;
    frame.body.stop_probe_answer.echo_station_time_us = outbox_.stop_probe_us();
  } else if (what == Outgoing::event) {
    frame.which_body = rheonaut_RobotFrame_event_tag;
    frame.body.event = events_.at(outbox_.event_seq());
  } else if (what == Outgoing::heartbeat) {
    frame.which_body = rheonaut_RobotFrame_heartbeat_tag;
    frame.body.heartbeat = outbox_.heartbeat();
  } else {
    const bool is_live = what == Outgoing::live;
    const SampleRun& run = outbox_.backfill();
    const std::size_t most = is_live ? samples_per_frame() : static_cast<std::size_t>(run.end_seq - run.next_seq);
    frame.which_body = rheonaut_RobotFrame_telemetry_tag;
    samples_.read(is_live ? outbox_.live_seq() : run.next_seq, most, frame.body.telemetry);
    if (!is_live) frame.body.telemetry.flags |= rheonaut_TELEMETRY_FLAG_BACKFILL;
  }
}

}  // namespace robot_fw
