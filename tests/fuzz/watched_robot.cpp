// Checks the robot against what can be known from outside.
#include "tests/fuzz/watched_robot.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/station_frames.hpp"

namespace fuzz {
namespace {

using robot_fw::Inputs;
using robot_fw::Robot;

constexpr std::uint64_t kTickUs = 10'000;
constexpr std::uint64_t kLeaseUs = protocol::kLeaseMs * 1000ULL;
constexpr std::uint64_t kMaxSilenceUs =
    35'000'000;                              // the longest link time-out and link_loss_limit_s; nothing moves beyond
constexpr std::uint64_t kLiveBacklog = 100;  // samples; what is older comes as backfill
// In one tick: hello, acks, pages, controller, events, live samples, status, heartbeat, backfill.
constexpr int kMaxFramesAtOnce = 1 + 16 + 4 + 1 + 32 + 101 + 1 + 1 + 50;

void require(bool holds, const char* rule) {
  if (holds) return;
  std::fprintf(stderr, "broken: %s\n", rule);
  std::abort();
}

bool same(float a, float b) { return std::memcmp(&a, &b, sizeof a) == 0; }

}  // namespace

WatchedRobot::WatchedRobot(const robot_fw::RobotConfig& config)
    : config_(config), robot_(config), latch_(robot_.emergency_id()) {
  if (latch_ != 0) latched_ids_.insert(latch_);
  check();
}

void WatchedRobot::check() const {
  const float duty = robot_.duty();
  require(std::isfinite(duty) && duty >= config_.duty_min && duty <= config_.duty_max, "the duty is in range");
  const bool latched = robot_.emergency_id() != 0;
  require(latched == (robot_.mode() == rheonaut_MODE_EMERGENCY), "latched is mode emergency");
  require(!latched || duty == 0, "latched, the motor is off");
}

void WatchedRobot::check_latch() {
  check();
  const std::uint64_t id = robot_.emergency_id();
  if (id == latch_) return;
  if (id == 0) require(cleared_ids_.count(latch_) != 0, "a latch ends only by a clear that names it");
  if (id != 0) require(latched_ids_.insert(id).second, "each stop has a new id");
  latch_ = id;
}

void WatchedRobot::check_at_rest() const {
  const bool silent = !received_at_us_ || now_us_ - *received_at_us_ > kMaxSilenceUs;
  require(!silent || (robot_.duty() == 0 && robot_.mode() != rheonaut_MODE_AUTO), "without a link nothing moves");
  const bool manual = robot_.mode() == rheonaut_MODE_MANUAL;
  require(!manual || robot_.duty() == 0 || now_us_ < moves_until_us_, "without a lease nothing moves");
}

void WatchedRobot::tick(const Inputs& inputs, float dt_s) {
  now_us_ = std::max(now_us_, inputs.robot_time_us);
  const float duty = robot_.step(inputs, dt_s).duty;
  inputs_ = inputs;
  ++made_;
  require(same(duty, robot_.duty()), "a tick returns the duty");
  check_latch();
  check_at_rest();
  if (made_ > live_next_seq_ + kLiveBacklog) live_may_skip_ = true;
  backfill_credit_ += 2;
}

void WatchedRobot::open() {
  if (open_) close();
  robot_.link_opened(now_us_);
  open_ = true;
  up_ = heard_welcome_ = hello_sent_ = false;
  between_frames_ = true;
  reader_.reset();
  check_latch();
}

void WatchedRobot::close() {
  robot_.link_closed(now_us_);
  open_ = up_ = false;
  check_latch();
}

void WatchedRobot::receive(protocol::Bytes bytes) {
  if (bytes.empty()) return;
  if (open_) observe(bytes);
  const bool goes_on = robot_.receive(bytes, now_us_);
  require(open_ || !goes_on, "a closed connection hears nothing");
  check_latch();
  if (!goes_on) return close();
  if (heard_welcome_ && !up_) {
    up_ = true;
    live_next_seq_ = made_;
    live_may_skip_ = false;
    backfill_credit_ = 0;
  }
}

void WatchedRobot::observe(protocol::Bytes bytes) {
  auto state = protocol::FrameReader::State::complete;
  while (!bytes.empty()) {
    state = reader_.push(bytes);
    if (state == protocol::FrameReader::State::oversize) return;
    if (state != protocol::FrameReader::State::complete) continue;
    if (const auto frame = protocol::decode_station_frame(reader_.payload())) observe(*frame);
  }
  between_frames_ = state == protocol::FrameReader::State::complete;
}

void WatchedRobot::observe(const protocol::StationFrame& frame) {
  received_at_us_ = now_us_;
  if (frame.which_body == rheonaut_StationFrame_welcome_tag) heard_welcome_ = true;
  if (frame.which_body != rheonaut_StationFrame_command_tag) return;
  const protocol::Command& command = frame.body.command;
  switch (command.which_action) {
    case rheonaut_Command_clear_emergency_tag: cleared_ids_.insert(command.action.clear_emergency.emergency_id); break;
    case rheonaut_Command_renew_lease_tag:
      if (!command.has_execute_at_robot_us && now_us_ >= moves_until_us_) break;  // what has lapsed stays lapsed
      [[fallthrough]];
    case rheonaut_Command_set_duty_tag:
    case rheonaut_Command_set_duty_schedule_tag: {
      const std::uint64_t latest_us = std::min(command.valid_until_robot_us, now_us_ + protocol::kMaxTimeToLiveUs);
      const std::uint64_t acts_by_us = command.has_execute_at_robot_us ? std::max(latest_us, now_us_) : now_us_;
      moves_until_us_ = std::max(moves_until_us_, acts_by_us + kLeaseUs);
    }
  }
}

std::size_t WatchedRobot::transmit(std::size_t capacity) {
  std::vector<std::uint8_t> out(capacity);  // of the exact size, so that a byte too many is seen
  const std::size_t size = robot_.transmit(out.data(), out.size(), now_us_);
  check_latch();
  if (size == 0) return 0;
  require(size <= capacity, "a frame fits where it is written");
  protocol::FrameReader reader;
  protocol::Bytes sent{out.data(), size};
  require(reader.push(sent) == protocol::FrameReader::State::complete && sent.empty(), "one whole frame is written");
  require(reader.payload().size <= protocol::kMaxFrameBytes, "a frame has at most 1024 bytes");
  const auto frame = protocol::decode_robot_frame(reader.payload());
  require(frame.has_value(), "a frame that is sent decodes");
  check_frame(*frame);
  return size;
}

void WatchedRobot::transmit_all() {
  acks_.clear();
  for (int frames = 0; transmit(protocol::kMaxFramedBytes) != 0; ++frames) {
    require(frames < kMaxFramesAtOnce, "sending comes to an end");
  }
}

void WatchedRobot::check_frame(const protocol::RobotFrame& frame) {
  require(open_, "a closed connection says nothing");
  require(frame.robot_time_us == now_us_ && now_us_ >= said_at_us_, "a frame carries the time at which it is made");
  said_at_us_ = now_us_;
  const bool hello = frame.which_body == rheonaut_RobotFrame_hello_tag;
  require(hello != hello_sent_, "the first frame is the hello, and no other");
  hello_sent_ = true;
  if (hello) require(frame.body.hello.next_seq == made_, "the hello counts the samples");
  const bool ack = frame.which_body == rheonaut_RobotFrame_command_ack_tag;
  require(hello || ack || up_, "before the welcome only stops are answered");
  if (ack) acks_.push_back(frame.body.command_ack);
  if (frame.which_body == rheonaut_RobotFrame_event_tag) {
    const auto& event = frame.body.event;
    require(event.event_seq >= event.oldest_event_seq, "an event that is sent is still held");
    require((event.emergency_id != 0) == (event.mode == rheonaut_MODE_EMERGENCY), "an event's latch is its mode");
    require(event.sample_seq <= made_, "an event's sample exists, or is the next");
  }
  if (frame.which_body == rheonaut_RobotFrame_telemetry_tag) check_telemetry(frame.body.telemetry);
}

void WatchedRobot::check_telemetry(const protocol::Telemetry& batch) {
  const std::uint64_t count = batch.position_m_count;
  require(count >= 1 && count <= protocol::kMaxSamplesPerFrame, "a batch has 1 to 25 samples");
  require(batch.first_seq >= batch.oldest_seq && batch.first_seq + count <= made_, "a sample that is sent was made");
  const bool latched = batch.mode == rheonaut_MODE_EMERGENCY;
  require(latched == (batch.emergency_id != 0), "a batch's latch is its mode");
  require(batch.has_setpoint_m == (batch.mode == rheonaut_MODE_AUTO), "auto, and only auto, has a setpoint");
  for (std::uint64_t i = 0; i < count; ++i) {
    const float duty = batch.duty[i];
    require(duty >= config_.duty_min && duty <= config_.duty_max, "a sample's duty is in range");
    require(!latched || duty == 0, "a sample's duty is 0 when latched");
    if (arrived_ != nullptr) arrived_->insert(batch.first_seq + i);
  }
  if (batch.flags & rheonaut_TELEMETRY_FLAG_BACKFILL) {
    require(count <= backfill_credit_, "backfill is at most twice the live rate");
    backfill_credit_ -= count;
  } else {
    check_live(batch);
  }
  last_batch_ = batch;
}

// Live samples are left out only when they are acknowledged, lost, or too many for live.
void WatchedRobot::check_live(const protocol::Telemetry& batch) {
  require(batch.first_seq >= live_next_seq_, "a live sample is sent once");
  const bool follows = batch.first_seq == live_next_seq_ || batch.first_seq <= batch.oldest_seq;
  require(follows || live_may_skip_, "live samples are consecutive");
  live_next_seq_ = batch.first_seq + batch.position_m_count;
  live_may_skip_ = made_ > live_next_seq_ + kLiveBacklog;
}

void WatchedRobot::order(const protocol::Command& command) {
  if (!can_order()) return;
  transmit_all();
  answer_to(command);
  if (command.command_id != 0) require(answer_to(command) != rheonaut_COMMAND_RESULT_ACCEPTED, "no command runs twice");
}

protocol::CommandResult WatchedRobot::answer_to(const protocol::Command& command) {
  Robot without = robot_;
  const float duty = robot_.duty();
  const auto mode = robot_.mode();
  const std::uint64_t latch = robot_.emergency_id();
  send(frame_of(command));
  require(open_, "a command closes no connection");
  if (command.which_action == rheonaut_Command_emergency_stop_tag) {
    require(robot_.emergency_id() != 0 && robot_.duty() == 0, "a stop is obeyed at once");
  }
  transmit_all();
  const auto ack = std::find_if(acks_.begin(), acks_.end(),
                                [&command](const auto& each) { return each.command_id == command.command_id; });
  require(ack != acks_.end(), "a command is answered at once");
  if (ack->result == rheonaut_COMMAND_RESULT_ACCEPTED) return ack->result;
  const bool unchanged = same(duty, robot_.duty()) && mode == robot_.mode() && latch == robot_.emergency_id();
  require(unchanged, "a refused command changes nothing");
  check_twins(robot_, without);
  return ack->result;
}

void WatchedRobot::send(const protocol::StationFrame& frame) {
  std::uint8_t bytes[protocol::kMaxFramedBytes];
  receive({bytes, protocol::write_frame(frame, bytes, sizeof bytes)});
}

void WatchedRobot::check_twins(Robot with, Robot without) const {
  protocol::Command ping = rheonaut_Command_init_zero;
  ping.which_action = rheonaut_Command_ping_tag;
  ping.command_id = 0xF1F1'0000'0000'0000 + made_;
  ping.boot_id = config_.boot_id;
  ping.valid_until_robot_us = now_us_;
  std::uint8_t bytes[protocol::kMaxFramedBytes];
  without.receive({bytes, protocol::write_frame(frame_of(ping), bytes, sizeof bytes)}, now_us_);
  Inputs inputs = inputs_;
  inputs.robot_time_us = now_us_;
  for (int tick = 0; tick < 20; ++tick) {
    inputs.robot_time_us += kTickUs;
    with.step(inputs, 0.01F);
    without.step(inputs, 0.01F);
    require(same(with.duty(), without.duty()) && with.mode() == without.mode(),
            "a refused command changes nothing later");
  }
}

void WatchedRobot::expect_every_sample() {
  open();
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_welcome_tag;
  frame.body.welcome.protocol_version = protocol::kProtocolVersion;
  send(frame);
  require(up_, "a welcome opens the link");
  std::set<std::uint64_t> arrived;
  arrived_ = &arrived;
  Inputs inputs = inputs_;
  inputs.robot_time_us = now_us_;
  for (int ticks = 0; ticks < 450; ++ticks) {  // 800 samples of backfill, 2 in each, and some to begin and to end with
    inputs.robot_time_us += kTickUs;
    tick(inputs, 0.01F);
    transmit_all();
  }
  require(last_batch_.has_value(), "samples arrive");
  for (std::uint64_t seq = last_batch_->oldest_seq; seq + protocol::kMaxSamplesPerFrame < made_; ++seq) {
    require(arrived.count(seq) != 0, "every sample arrives that is still held");
  }
  arrived_ = nullptr;
}

}  // namespace fuzz
