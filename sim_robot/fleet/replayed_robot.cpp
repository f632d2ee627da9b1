// Keeps the numbers of a robot and takes its frames from the recording.
#include "sim_robot/fleet/replayed_robot.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "base/version.hpp"
#include "sim_robot/fleet/fleet.hpp"

namespace sim_robot {
namespace {

constexpr std::uint64_t kStatusPeriodUs = 1'000'000;
constexpr int kBackfillPerTurn = 2;  // frames, against the one that is made
constexpr std::size_t kMaxCommands = 8;

template <std::size_t size>
void copy_text(char (&to)[size], const std::string& from) {
  std::strncpy(to, from.c_str(), size - 1);
  to[size - 1] = '\0';
}

}  // namespace

ReplayedRobot::ReplayedRobot(boost::asio::io_context& loop, ReplayConfig config, const Recording& recording,
                             StationAddress station, LinkLog log)
    : config_(std::move(config)),
      recording_(recording),
      booted_at_(Clock::now()),
      connection_(loop, *this, std::move(station), config_.robot_id, std::move(log)) {}

// A whole number of turns to a frame, of whole slots if that can be; often enough for heartbeats.
std::chrono::microseconds ReplayedRobot::turn_period(const Recording& recording, std::uint32_t period_us) {
  constexpr std::uint64_t kShortestUs = Fleet::kSlotUs, kLongestUs = 100'000, kMostTurns = 32;
  const std::uint64_t frame_us = recording.samples() * period_us / recording.frames();
  std::uint64_t turns = (frame_us + kLongestUs - 1) / kLongestUs;
  while (turns < kMostTurns && frame_us % (turns * Fleet::kSlotUs) != 0) ++turns;
  return std::chrono::microseconds(std::clamp(frame_us / turns, kShortestUs, kLongestUs));
}

std::uint64_t ReplayedRobot::robot_time_us() const {
  const auto since_boot = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - booted_at_);
  return static_cast<std::uint64_t>(std::max<std::int64_t>(since_boot.count(), 0));
}

// When the last sample of the frame is made.
FleetMember::Clock::time_point ReplayedRobot::next_tick_at() const {
  return booted_at_ + std::chrono::microseconds((recording_.end_seq(next_) - 1) * config_.period_us);
}

bool ReplayedRobot::tick() {
  make_frames();
  backfill_credit_ = kBackfillPerTurn;
  const bool is_open = connection_.is_open() && phase_ != Phase::closed;
  if (is_open && robot_time_us() > received_at_us_ + silence_us_) connection_.close_as_silent();
  return connection_.prepare();
}

void ReplayedRobot::make_frames() {
  const std::uint64_t now_us = robot_time_us();
  while ((recording_.end_seq(next_) - 1) * config_.period_us <= now_us) {
    ++next_;
    live_.end = next_;
  }
  while (recording_.first_seq(next_) - oldest_seq() > kRingSamples) {
    if (!std::exchange(gap_grows_, true)) overwritten_.push_back({oldest_seq(), oldest_seq()});
    overwritten_.back().next = recording_.end_seq(oldest_);
    counts_.lost += overwritten_.back().next - oldest_seq();
    ++oldest_;
  }
}

void ReplayedRobot::on_opened() {
  phase_ = Phase::greeting;
  refusal_ = rheonaut_REFUSAL_REASON_NONE;
  reader_.reset();
  hello_is_due_ = true;
  received_at_us_ = robot_time_us();
  silence_us_ = protocol::kDefaultLinkTimeoutMs * 1000ULL;
}

bool ReplayedRobot::on_bytes(protocol::Bytes bytes) {
  make_frames();
  while (!bytes.empty()) {
    const auto state = reader_.push(bytes);
    if (state == protocol::FrameReader::State::oversize) return false;
    if (state == protocol::FrameReader::State::incomplete) break;
    const auto frame = protocol::decode_station_frame(reader_.payload());
    if (!frame || !on_frame(*frame)) return false;
  }
  return true;
}

bool ReplayedRobot::on_frame(const protocol::StationFrame& frame) {
  received_at_us_ = robot_time_us();
  if (frame.which_body == rheonaut_StationFrame_welcome_tag) {
    return phase_ == Phase::greeting && on_welcome(frame.body.welcome);
  }
  if (frame.which_body == rheonaut_StationFrame_command_tag) {
    ++counts_.commands;
    if (commands_.size() < kMaxCommands) commands_.push_back(frame.body.command.command_id);
  } else if (frame.which_body == rheonaut_StationFrame_stop_probe_tag) {
    stop_probe_us_ = frame.body.stop_probe.station_time_us;
  } else {
    const protocol::StationHeartbeat& heartbeat = frame.body.heartbeat;
    acknowledge(heartbeat.durable_next_seq);
    resend(heartbeat.resend_first_seq, heartbeat.resend_next_seq);
    if (heartbeat.station_time_us != 0) echo_ = {heartbeat.station_time_us, received_at_us_};
  }
  return true;
}

bool ReplayedRobot::on_welcome(const protocol::Welcome& welcome) {
  refusal_ = welcome.refusal;
  if (refusal_ != rheonaut_REFUSAL_REASON_NONE) return false;
  phase_ = Phase::up;
  const auto or_default = [](std::uint32_t requested_ms, std::uint32_t preset_ms) {
    return (requested_ms == 0 ? preset_ms : requested_ms) * 1000ULL;
  };
  silence_us_ = or_default(welcome.link_timeout_ms, protocol::kDefaultLinkTimeoutMs);
  heartbeat_us_ = or_default(welcome.heartbeat_interval_ms, protocol::kDefaultHeartbeatIntervalMs);
  acknowledge(welcome.durable_next_seq);
  backfill_ = {oldest_, next_};
  live_ = {next_, next_};
  status_due_us_ = 0;
  sent_at_us_ = received_at_us_;
  return true;
}

// A frame is held until all of it is durable.
void ReplayedRobot::acknowledge(std::uint64_t next_seq) {
  if (next_seq > recording_.first_seq(next_)) return;
  acknowledged_next_seq_ = std::max(acknowledged_next_seq_, next_seq);
  const auto now_us = static_cast<std::int64_t>(robot_time_us());
  while (oldest_ < next_ && recording_.end_seq(oldest_) <= next_seq) {
    const std::uint64_t made_us = (recording_.end_seq(oldest_) - 1) * config_.period_us;
    if (config_.acknowledged_after) config_.acknowledged_after->add(now_us - static_cast<std::int64_t>(made_us));
    ++oldest_;
    gap_grows_ = false;
  }
}

void ReplayedRobot::resend(std::uint64_t first_seq, std::uint64_t end_seq) {
  if (first_seq >= end_seq || first_seq >= recording_.first_seq(next_)) return;
  const std::uint64_t from = std::max(oldest_, recording_.frame_of(first_seq));
  const std::uint64_t to = std::min(next_, recording_.frame_of(end_seq - 1) + 1);
  const bool is_idle = backfill_.next >= backfill_.end;
  backfill_ = {is_idle ? from : std::min(from, backfill_.next), is_idle ? to : std::max(to, backfill_.end)};
}

// In the order of the robot's outbox: hello, answer to a stop probe, acks, live, status, heartbeat, backfill.
std::size_t ReplayedRobot::next_frame(std::uint8_t* out, std::size_t capacity) {
  live_.next = std::max(live_.next, oldest_);
  backfill_.next = std::max(backfill_.next, oldest_);
  const bool is_greeted = phase_ == Phase::up && !hello_is_due_;
  if (is_greeted && stop_probe_us_ == 0 && commands_.empty() && live_.next < live_.end)
    return write_telemetry(live_, false, out, capacity);
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.robot_time_us = robot_time_us();
  if (fill_small_frame(frame)) {
    sent_at_us_ = frame.robot_time_us;
    return protocol::write_frame(frame, out, capacity);
  }
  if (!is_greeted || backfill_.next >= backfill_.end || backfill_credit_ == 0) return 0;
  --backfill_credit_;
  return write_telemetry(backfill_, true, out, capacity);
}

std::size_t ReplayedRobot::write_telemetry(Run& run, bool again, std::uint8_t* out, std::size_t capacity) {
  sent_at_us_ = robot_time_us();
  const std::size_t size =
      recording_.write(run.next, {sent_at_us_, config_.period_us, oldest_seq(), again}, out, capacity);
  const std::uint64_t samples = recording_.end_seq(run.next) - recording_.first_seq(run.next);
  ++run.next;
  counts_.sent += samples;
  if (again) counts_.resent += samples;
  return size;
}

// False when nothing but telemetry is due.
bool ReplayedRobot::fill_small_frame(protocol::RobotFrame& frame) {
  const std::uint64_t now_us = frame.robot_time_us;
  if (phase_ == Phase::closed) return false;
  if (std::exchange(hello_is_due_, false)) {
    frame.which_body = rheonaut_RobotFrame_hello_tag;
    fill_hello(frame.body.hello);
    return true;
  }
  if (phase_ != Phase::up) return false;
  if (stop_probe_us_ != 0) {
    frame.which_body = rheonaut_RobotFrame_stop_probe_answer_tag;
    frame.body.stop_probe_answer.echo_station_time_us = std::exchange(stop_probe_us_, 0);
    return true;
  }
  if (!commands_.empty()) {
    frame.which_body = rheonaut_RobotFrame_command_ack_tag;
    frame.body.command_ack.command_id = commands_.front();
    frame.body.command_ack.result = rheonaut_COMMAND_RESULT_REJECTED;
    frame.body.command_ack.reason = rheonaut_REJECT_REASON_UNSUPPORTED;
    commands_.pop_front();
    return true;
  }
  if (now_us >= status_due_us_) {
    status_due_us_ = now_us + kStatusPeriodUs;
    frame.which_body = rheonaut_RobotFrame_status_tag;
    frame.body.status.supply_mv = 3000;
    frame.body.status.ring_fill = static_cast<std::uint32_t>(recording_.first_seq(next_) - oldest_seq());
    frame.body.status.lost_samples = static_cast<std::uint32_t>(counts_.lost);
    return true;
  }
  if (echo_.echo_station_time_us == 0 && now_us < sent_at_us_ + heartbeat_us_) return false;
  frame.which_body = rheonaut_RobotFrame_heartbeat_tag;
  frame.body.heartbeat = std::exchange(echo_, rheonaut_Heartbeat_init_zero);
  return true;
}

void ReplayedRobot::fill_hello(protocol::Hello& hello) const {
  hello.protocol_version = protocol::kProtocolVersion;
  copy_text(hello.robot_id, config_.robot_id);
  copy_text(hello.token, config_.token);
  copy_text(hello.firmware_version, ("sim-" + std::string{base::version()} + " replay").c_str());
  hello.boot_id = config_.boot_id;
  hello.reset_cause = rheonaut_RESET_CAUSE_POWER_ON;
  hello.sample_period_us = config_.period_us;
  hello.ring_capacity = kRingSamples;
  hello.oldest_seq = oldest_seq();
  hello.next_seq = recording_.first_seq(next_);
  hello.acknowledged_next_seq = acknowledged_next_seq_;
  hello.mode = rheonaut_MODE_MANUAL;
  hello.answers_stop_probes = true;
}

SampleCounts ReplayedRobot::samples() const {
  SampleCounts counts = counts_;
  counts.gaps = overwritten_.size();
  counts.made = recording_.first_seq(next_);
  counts.held = counts.made - oldest_seq();
  counts.acknowledged = oldest_seq() - counts.lost;
  return counts;
}

}  // namespace sim_robot
