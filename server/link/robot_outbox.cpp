// Chooses, encodes and writes the next frame.
#include "server/link/robot_outbox.hpp"

#include <algorithm>
#include <utility>

namespace server::link {
namespace {

constexpr std::int64_t kProbePeriodUs = 1'000'000;
constexpr std::int64_t kEarlyUs = 20'000;  // a heartbeat may leave before it is due, together with something else

}  // namespace

void RobotOutbox::welcome(const protocol::Welcome& welcome) {
  welcome_ = welcome;
  heartbeat_.durable_next_seq = welcome.durable_next_seq;
  heartbeat_.durable_next_event_seq = welcome.durable_next_event_seq;
}

bool RobotOutbox::enqueue(const protocol::Command& command, std::int64_t deadline_us) {
  if (commands_.size() >= kMaxQueuedCommands) return false;
  commands_.push_back({command, deadline_us});
  return true;
}

bool RobotOutbox::withdraw(station::CommandId id) {
  return std::erase_if(commands_, [id](const QueuedCommand& queued) { return queued.command.command_id == id; }) > 0;
}

void RobotOutbox::enqueue_stop(const protocol::Command& command) {
  commands_.clear();  // SAFETY: a stop supersedes everything queued for this robot
  if (stops_.size() >= kMaxQueuedStops) stops_.pop_front();
  stops_.push_back(command);
}

// It waits for the robot's next frame: a commit is of many robots, and writing to all of them would hold the loop up.
void RobotOutbox::set_durable(std::uint64_t next_seq, std::uint64_t next_event_seq) {
  heartbeat_.durable_next_seq = next_seq;
  heartbeat_.durable_next_event_seq = next_event_seq;
  heartbeat_wanted_ = true;
}

void RobotOutbox::request_resend(std::uint64_t first_seq, std::uint64_t next_seq) {
  heartbeat_.resend_first_seq = first_seq;
  heartbeat_.resend_next_seq = next_seq;
  heartbeat_wanted_ = true;
}

void RobotOutbox::request_event_resend() {
  heartbeat_.resend_events = true;
  heartbeat_wanted_ = true;
}

void RobotOutbox::on_received(std::int64_t now_us) {
  if (now_us + kEarlyUs >= next_heartbeat_us_) heartbeat_wanted_ = true;
}

void RobotOutbox::on_ack(const protocol::CommandAck& ack) {
  if (ack.command_id == awaited_stop_) awaited_stop_ = 0;
  if (ack.command_id == awaited_command_) awaited_command_ = 0;
  window_.answered(ack);
}

bool RobotOutbox::on_probe_answer(std::uint64_t echo_station_time_us) {
  if (echo_station_time_us == 0 || echo_station_time_us != probe_us_) return false;
  probe_us_ = 0;
  return true;
}

std::optional<RobotOutbox::Written> RobotOutbox::write_next(std::int64_t now_us, const Writer& write) {
  if (!unsent_.empty()) return std::nullopt;
  const auto frame = next_frame(now_us);
  if (!frame) return std::nullopt;
  const std::size_t size = protocol::write_frame(*frame, output_.data(), output_.size());
  const std::size_t taken = write({output_.data(), size});
  unsent_ = {output_.data() + taken, size - taken};
  if (frame->which_body != rheonaut_StationFrame_command_tag) return Written{};
  return Written{frame->body.command.command_id};
}

std::optional<protocol::StationFrame> RobotOutbox::next_frame(std::int64_t now_us) {
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  if (welcome_) {
    frame.which_body = rheonaut_StationFrame_welcome_tag;
    frame.body.welcome = *std::exchange(welcome_, std::nullopt);
    return frame;
  }
  frame.which_body = rheonaut_StationFrame_command_tag;
  // SAFETY: an emergency stop goes ahead of everything that waits, and a probe where a stop would if there were one.
  if (take_stop(frame.body.command)) return frame;
  if (stop_probes_.is_due(now_us)) {
    frame.which_body = rheonaut_StationFrame_stop_probe_tag;
    frame.body.stop_probe.station_time_us = stop_probes_.take(now_us);
    return frame;
  }
  if (take_command(now_us, frame.body.command)) return frame;
  if (!heartbeat_wanted_ && now_us < next_heartbeat_us_) return std::nullopt;
  frame.which_body = rheonaut_StationFrame_heartbeat_tag;
  frame.body.heartbeat = take_heartbeat(now_us);
  return frame;
}

bool RobotOutbox::take_stop(protocol::Command& command) {
  if (stops_.empty()) return false;
  command = stops_.front();
  stops_.pop_front();
  awaited_stop_ = command.command_id;
  return true;
}

bool RobotOutbox::take_command(std::int64_t now_us, protocol::Command& command) {
  // SAFETY: what waited longer than its validity is never sent.
  while (!commands_.empty() && now_us >= commands_.front().deadline_us) commands_.pop_front();
  if (commands_.empty() || !window_.has_room(commands_.front().command, now_us)) return false;
  command = commands_.front().command;
  window_.written(command, commands_.front().deadline_us);
  commands_.pop_front();
  awaited_command_ = command.command_id;
  return true;
}

protocol::StationHeartbeat RobotOutbox::take_heartbeat(std::int64_t now_us) {
  protocol::StationHeartbeat heartbeat = heartbeat_;
  if (now_us >= next_probe_us_) {
    probe_us_ = static_cast<std::uint64_t>(std::max<std::int64_t>(now_us, 1));
    heartbeat.station_time_us = probe_us_;
    next_probe_us_ = now_us + kProbePeriodUs;
  }
  heartbeat_.resend_first_seq = heartbeat_.resend_next_seq = 0;
  heartbeat_.resend_events = false;
  heartbeat_wanted_ = false;
  next_heartbeat_us_ = now_us + heartbeat_interval_us_;
  return heartbeat;
}

}  // namespace server::link
