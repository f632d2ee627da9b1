// Serves one robot's connection.
// LONG: reading, writing and watching of one connection, which share its state and are understood together.
#include "server/link/robot_session.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <cstring>
#include <utility>

#include "server/runtime/exceptions.hpp"

namespace server {
namespace asio = boost::asio;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

namespace {

constexpr std::int64_t kProbePeriodUs = 1'000'000;
constexpr std::int64_t kEarlyUs = 20'000;  // a sign of life may leave before it is due, together with something else
constexpr auto kClosedByRobot = "the robot closed the connection";
constexpr auto kFault = "a fault of the station; its log says which";
constexpr std::int64_t kGridUs = 4'000;  // at whose multiples sessions wake, many at once

template <std::size_t size>
void copy_text(char (&to)[size], const std::string& from) {
  const std::size_t count = std::min(from.size(), size - 1);
  std::memcpy(to, from.data(), count);
  to[count] = '\0';
}

bool is_robot_id(const std::string& id) {
  constexpr auto kAllowed = "abcdefghijklmnopqrstuvwxyz0123456789_-";
  return !id.empty() && id.find_first_not_of(kAllowed) == std::string::npos;
}

AdmissionRequest admission_request(const protocol::Hello& hello, std::uint64_t robot_time_us, const ByteStream& stream,
                                   std::int64_t utc_us) {
  AdmissionRequest request;
  request.robot_id = hello.robot_id;
  request.token = hello.token;
  request.from_loopback = stream.from_loopback();
  request.boot_id = hello.boot_id;
  request.reset_cause = hello.reset_cause;
  request.firmware_version = hello.firmware_version;
  request.sample_period_us = hello.sample_period_us;
  request.robot_time_us = robot_time_us;
  request.oldest_seq = hello.oldest_seq;
  request.next_seq = hello.next_seq;
  request.oldest_event_seq = hello.oldest_event_seq;
  request.next_event_seq = hello.next_event_seq;
  request.acknowledged_next_seq = hello.acknowledged_next_seq;
  request.acknowledged_next_event_seq = hello.acknowledged_next_event_seq;
  request.received_at_us = utc_us;
  return request;
}

}  // namespace

RobotSession::RobotSession(asio::io_context& loop, Clock& clock, std::unique_ptr<ByteStream> stream, Station& station,
                           RobotArchive& archive, ReadBuffers& buffers)
    : clock_{clock},
      stream_{std::move(stream)},
      station_{station},
      archive_{archive},
      buffers_{buffers},
      reading_paused_{loop},
      wake_writer_{loop} {}

// Also of one that was never served. What is to be said of its end may fail; the end itself does not.
RobotSession::~RobotSession() {
  try {
    station_.on_disconnected(*this, "the station stops");
  } catch (const std::exception& error) {
    spdlog::error("robot '{}': {}", robot_id_, error.what());
  }
}

// What has come with the hello waits until the robot is welcome.
asio::awaitable<bool> RobotSession::greet() {
  const std::int64_t late_us = clock_.steady_us() + microseconds{kHelloTime}.count();
  stream_->on_readable([this] { read(); });
  const bool has_come = co_await reading_paused_.wait_until(clock_, late_us);
  stream_->on_readable(nullptr);
  if (failure_) std::rethrow_exception(failure_);
  if (!has_come) close_reason_ = "no hello within 5 s";
  if (close_reason_ == kClosedByRobot) close_reason_ = "closed before its hello";
  co_return close_reason_.empty() && co_await admit(*hello_);
}

asio::awaitable<void> RobotSession::serve() {
  std::string reason;
  try {
    const auto ended = co_await (part(read_frames()) || part(write_frames()) || part(watch_link()));
    std::visit([&reason](const EndReason& end) { reason = end; }, ended);
  } catch (const std::exception&) {  // all three were cancelled
    reason = "the station stops";
  }
  stream_->on_readable(nullptr);
  stream_->close();
  station_.on_disconnected(*this, close_reason_.empty() ? reason : close_reason_);
  if (failure_) std::rethrow_exception(failure_);
}

// By an exception the session ends: its other parts do not go on without this one.
asio::awaitable<RobotSession::EndReason> RobotSession::part(asio::awaitable<EndReason> task) {
  try {
    co_return co_await std::move(task);
  } catch (...) {
    const std::exception_ptr failure = first_of(std::current_exception());
    if (is_cancellation(failure)) std::rethrow_exception(failure);
    failure_ = failure;
  }
  co_return kFault;
}

void RobotSession::read() {
  const bool is_greeted = !hello_ || !robot_id_.empty();  // what comes between the hello and the welcome, waits
  if (!is_greeted) return;
  try {
    if (!close_reason_.empty()) return reading_paused_.notify();
    const ByteStream::Read got = stream_->read_now(asio::buffer(buffers_.input));
    if (got.size > 0) last_received_us_ = clock_.steady_us();
    work_off({buffers_.input.data(), got.size});
    if (got.has_ended && close_reason_.empty()) close_reason_ = kClosedByRobot;
    if (!close_reason_.empty()) reading_paused_.notify();
  } catch (...) {
    failure_ = std::current_exception();
    reading_paused_.notify();
  }
}

void RobotSession::work_off(protocol::Bytes unread) {
  while (close_reason_.empty() && decode_next_of(unread)) {
    if (!hello_) {
      after_hello_.assign(unread.begin(), unread.end());
      return on_hello(buffers_.frame);
    }
    on_frame(buffers_.frame);
  }
  if (!close_reason_.empty()) return reading_paused_.notify();
  if (last_received_us_ + kEarlyUs >= next_heartbeat_us_) heartbeat_wanted_ = true;
  if ((heartbeat_wanted_ || !commands_.empty()) && !robot_id_.empty()) flush();
}

// Into the buffer of a frame; false when there is none, or a fault (then close_reason_ is set). What a robot that is
// welcome has sent and does not decode is passed over: the robot would send it again over the next connection.
bool RobotSession::decode_next_of(protocol::Bytes& unread) {
  for (;;) {
    const auto state = reader_.push(unread);
    if (state == protocol::FrameReader::State::oversize)
      close_reason_ = "a frame longer than 1024 bytes: not this protocol";
    if (state != protocol::FrameReader::State::complete) return false;
    if (protocol::decode_robot_frame(reader_.payload(), buffers_.frame)) return true;
    if (robot_id_.empty()) break;
    station_.on_frame(*this, 0);  // SAFETY: a sign of life: what a stop's repetition and the ends of commands wait for
    station_.on_invalid_values(*this, 1, "malformed", "a frame does not decode");
  }
  close_reason_ = "a frame that does not decode";
  return false;
}

void RobotSession::on_hello(const protocol::RobotFrame& frame) {
  if (frame.which_body == rheonaut_RobotFrame_hello_tag) {
    hello_ = frame.body.hello;
    hello_robot_time_us_ = frame.robot_time_us;
  } else {
    close_reason_ = "the first frame is not a hello";
  }
  reading_paused_.notify();
}

// Checks the hello, asks the archive, and takes the robot's seat or refuses it.
asio::awaitable<bool> RobotSession::admit(const protocol::Hello& hello) {
  const std::string id = hello.robot_id;
  if (hello.protocol_version != protocol::kProtocolVersion) {
    co_return co_await refuse(rheonaut_REFUSAL_REASON_VERSION,
                              "this station speaks protocol version " + std::to_string(protocol::kProtocolVersion) +
                                  ", the robot " + std::to_string(hello.protocol_version));
  }
  if (!is_robot_id(id) || hello.boot_id == 0 || hello.oldest_seq > hello.next_seq || hello.next_seq > kMaxNumber ||
      hello.oldest_event_seq > hello.next_event_seq || hello.next_event_seq > kMaxNumber ||
      hello_robot_time_us_ > kMaxNumber) {
    co_return co_await refuse(rheonaut_REFUSAL_REASON_MALFORMED,
                              "robot_id must be 1 to 31 of [a-z0-9_-], boot_id not 0, and oldest_seq ≤ next_seq");
  }
  claimed_id_ = id;
  const auto request = admission_request(hello, hello_robot_time_us_, *stream_, clock_.utc_us());
  auto seat = station_.may_connect(id, hello.boot_id);
  if (!seat) co_return co_await refuse(rheonaut_REFUSAL_REASON_ALREADY_CONNECTED, seat.error().detail);
  const Admission admission = co_await archive_.admit(request);
  if (admission.enrolment_full) station_.on_enrolment_refused(id, stream_->peer(), admission.detail);
  if (admission.refusal != rheonaut_REFUSAL_REASON_NONE) co_return co_await refuse(admission.refusal, admission.detail);
  seat = station_.may_connect(id, hello.boot_id);  // another connection may have won while we asked
  if (!seat) co_return co_await refuse(rheonaut_REFUSAL_REASON_ALREADY_CONNECTED, seat.error().detail);

  robot_id_ = id;
  reach_ = FrameReach::after(hello, hello_robot_time_us_);
  welcome_ = welcome(admission);
  durable_.durable_next_seq = admission.durable_next_seq;
  durable_.durable_next_event_seq = admission.durable_next_event_seq;
  last_received_us_ = clock_.steady_us();
  station_.on_connected(*this, request, hello, admission, stream_->peer());
  co_return true;
}

protocol::StationFrame RobotSession::welcome(const Admission& admission) const {
  const LinkTimes times = station_.link_times();
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_welcome_tag;
  protocol::Welcome& welcome = frame.body.welcome;
  welcome.protocol_version = protocol::kProtocolVersion;
  welcome.store_id = admission.store_id;
  welcome.durable_next_seq = admission.durable_next_seq;
  welcome.durable_next_event_seq = admission.durable_next_event_seq;
  welcome.link_timeout_ms = times.link_timeout_ms;
  welcome.heartbeat_interval_ms = times.heartbeat_interval_ms;
  welcome.samples_per_frame = times.samples_per_frame;
  welcome.utc_us = clock_.utc_us();
  return frame;
}

asio::awaitable<bool> RobotSession::refuse(protocol::RefusalReason reason, std::string detail) {
  close_reason_ = std::string{protocol::text(reason)} + ": " + detail;
  station_.on_refused(claimed_id_, stream_->peer(), reason, detail);
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_welcome_tag;
  frame.body.welcome.protocol_version = protocol::kProtocolVersion;
  frame.body.welcome.refusal = reason;
  copy_text(frame.body.welcome.detail, detail);
  const std::size_t size = protocol::write_frame(frame, output_.data(), output_.size());
  co_await stream_->write(asio::buffer(output_.data(), size));
  co_return false;
}

asio::awaitable<RobotSession::EndReason> RobotSession::read_frames() {
  const std::vector<std::uint8_t> first = std::move(after_hello_);
  work_off({first.data(), first.size()});
  stream_->on_readable([this] { read(); });
  tell_what_is_awaited();
  co_await reading_paused_.wait();
  co_return failure_ ? kFault : close_reason_;
}

void RobotSession::on_frame(protocol::RobotFrame& frame) {
  if (frame.which_body == rheonaut_RobotFrame_hello_tag) {
    close_reason_ = "a second hello on one connection";
    return;
  }
  const FrameFaults faults = mend(frame, reach_);
  if (!faults.is_unusable) reach_.advance(frame);
  station_.on_frame(*this, frame.robot_time_us);
  if (faults.count > 0) station_.on_invalid_values(*this, faults.count, faults.cause, faults.first);
  if (faults.is_unusable) return faults.has_number ? give_up(frame) : void();
  if (frame.which_body != rheonaut_RobotFrame_command_ack_tag) {
    window_.robot_time_is(frame.robot_time_us, hello_->sample_period_us);
  }
  switch (frame.which_body) {
    case rheonaut_RobotFrame_telemetry_tag: station_.on_samples(*this, frame.body.telemetry); break;
    case rheonaut_RobotFrame_event_tag:
      window_.ended(frame.body.event.command_id);  // the answer came before the event of its command, or never will
      station_.on_event(*this, frame.body.event);
      break;
    case rheonaut_RobotFrame_status_tag: station_.on_status(*this, frame.body.status); break;
    case rheonaut_RobotFrame_parameter_page_tag: station_.on_parameters(*this, frame.body.parameter_page); break;
    case rheonaut_RobotFrame_controller_tag: station_.on_controller(*this, frame.body.controller); break;
    case rheonaut_RobotFrame_command_ack_tag:
      if (frame.body.command_ack.command_id == awaited_stop_) awaited_stop_ = 0;
      if (frame.body.command_ack.command_id == awaited_command_) awaited_command_ = 0;
      window_.answered(frame.body.command_ack);
      station_.on_command_ack(*this, frame.body.command_ack);
      tell_what_is_awaited();
      break;
    case rheonaut_RobotFrame_heartbeat_tag: on_heartbeat(frame); break;
    default: break;  // a message of a newer version
  }
}

// What cannot be recorded is lost for good, so that the robot need not send it for ever.
void RobotSession::give_up(const protocol::RobotFrame& frame) {
  if (frame.which_body == rheonaut_RobotFrame_event_tag) return station_.on_unusable_event(*this, frame.body.event);
  station_.on_unusable_samples(*this, frame.body.telemetry);
}

void RobotSession::on_heartbeat(const protocol::RobotFrame& frame) {
  const protocol::Heartbeat& answer = frame.body.heartbeat;
  if (answer.echo_station_time_us == 0 || answer.echo_station_time_us != probe_us_) return;
  probe_us_ = 0;
  tell_what_is_awaited();
  ClockExchange exchange;
  exchange.sent_at_us = static_cast<std::int64_t>(answer.echo_station_time_us);
  exchange.received_at_robot_us = static_cast<std::int64_t>(answer.echo_received_at_robot_us);
  exchange.answered_at_robot_us = static_cast<std::int64_t>(frame.robot_time_us);
  exchange.answer_received_at_us = last_received_us_;
  station_.on_clock(*this, exchange);
}

// Carries on where flush() cannot: with a stream that takes no more for now.
asio::awaitable<RobotSession::EndReason> RobotSession::write_frames() {
  for (;;) {
    flush();
    if (unsent_.empty()) {
      co_await wake_writer_.wait();
      continue;
    }
    const bool written = co_await stream_->write(asio::buffer(unsent_.first, unsent_.size));
    if (!written) co_return kClosedByRobot;
    unsent_ = {};
    writing_since_us_.reset();
  }
}

// Writes what is ready, in order of urgency, as far as the stream takes it at once.
void RobotSession::flush() {
  if (!unsent_.empty()) return;  // the writer goes on here
  while (unsent_.empty()) {
    const auto frame = next_frame();
    if (!frame) return;
    const std::size_t size = protocol::write_frame(*frame, output_.data(), output_.size());
    const std::size_t taken = stream_->write_now(asio::buffer(output_.data(), size));
    unsent_ = {output_.data() + taken, size - taken};
    // SAFETY: the frame first, what the station says of it afterwards.
    if (frame->which_body == rheonaut_StationFrame_command_tag) {
      station_.on_command_sent(*this, frame->body.command.command_id);
    }
    tell_what_is_awaited();
  }
  writing_since_us_ = clock_.steady_us();
  wake_writer_.notify();
}

// SAFETY: the answer to an emergency stop waits behind no other robot. Nor does that to a probe, which measures time.
void RobotSession::tell_what_is_awaited() {
  stream_->set_awaited(awaited_stop_ != 0 || awaited_command_ != 0 || probe_us_ != 0);
}

std::optional<protocol::StationFrame> RobotSession::next_frame() {
  if (welcome_) return std::exchange(welcome_, std::nullopt);
  const std::int64_t now_us = clock_.steady_us();
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_command_tag;
  if (!stops_.empty()) {  // SAFETY: an emergency stop goes ahead of everything that waits
    frame.body.command = stops_.front();
    stops_.pop_front();
    awaited_stop_ = frame.body.command.command_id;
    return frame;
  }
  while (!commands_.empty()) {
    const QueuedCommand next = commands_.front();
    const bool is_too_old = now_us >= next.deadline_us;  // SAFETY: what waited longer than its life is never sent
    if (!is_too_old && !window_.has_room(next.command, now_us)) break;
    commands_.pop_front();
    if (is_too_old) continue;
    window_.written(next.command, next.deadline_us);
    frame.body.command = next.command;
    awaited_command_ = next.command.command_id;
    return frame;
  }
  if (heartbeat_wanted_ || now_us >= next_heartbeat_us_) return heartbeat();
  return std::nullopt;
}

protocol::StationFrame RobotSession::heartbeat() {
  const std::int64_t now_us = clock_.steady_us();
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_heartbeat_tag;
  frame.body.heartbeat = durable_;
  if (now_us >= next_probe_us_) {
    probe_us_ = static_cast<std::uint64_t>(std::max<std::int64_t>(now_us, 1));
    frame.body.heartbeat.station_time_us = probe_us_;
    next_probe_us_ = now_us + kProbePeriodUs;
  }
  durable_.resend_first_seq = durable_.resend_next_seq = 0;
  durable_.resend_events = false;
  heartbeat_wanted_ = false;
  next_heartbeat_us_ = now_us + std::int64_t{station_.link_times().heartbeat_interval_ms} * 1000;
  return frame;
}

// A robot that is silent, or that does not take what we write, is lost: TCP alone would notice much later. Signs of
// life leave from here.
asio::awaitable<RobotSession::EndReason> RobotSession::watch_link() {
  const std::int64_t timeout_us = std::int64_t{station_.link_times().link_timeout_ms} * 1000;
  for (;;) {
    const std::int64_t now_us = clock_.steady_us();
    if (now_us - last_received_us_ >= timeout_us) co_return "no frame within the link time-out";
    if (writing_since_us_ && now_us - *writing_since_us_ >= timeout_us) co_return "the robot does not read";
    if (now_us >= next_heartbeat_us_) flush();
    const std::int64_t silent_since_us = std::min(last_received_us_, writing_since_us_.value_or(last_received_us_));
    const std::int64_t lost_us = silent_since_us + timeout_us;
    const std::int64_t due_us = unsent_.empty() ? std::min(lost_us, next_heartbeat_us_) : lost_us;
    co_await clock_.sleep_until((due_us + kGridUs - 1) / kGridUs * kGridUs);
  }
}

bool RobotSession::send(const protocol::Command& command, std::int64_t deadline_us) {
  if (commands_.size() >= kMaxQueuedCommands) return false;
  commands_.push_back({command, deadline_us});
  wake_writer_.notify();
  return true;
}

bool RobotSession::withdraw(CommandId id) {
  return std::erase_if(commands_, [id](const QueuedCommand& queued) { return queued.command.command_id == id; }) > 0;
}

void RobotSession::send_emergency_stop(const protocol::Command& command) {
  commands_.clear();  // SAFETY: a stop supersedes everything queued for this robot
  if (stops_.size() >= kMaxQueuedStops) stops_.pop_front();
  stops_.push_back(command);
  flush();  // SAFETY: it leaves now, not at the writer's next turn
}

void RobotSession::acknowledge(std::uint64_t durable_next_seq, std::uint64_t durable_next_event_seq) {
  durable_.durable_next_seq = durable_next_seq;
  durable_.durable_next_event_seq = durable_next_event_seq;
  heartbeat_wanted_ =
      true;  // said after the robot's next frame: a commit is of many robots, and holds the loop up else
}

void RobotSession::request_resend(std::uint64_t first_seq, std::uint64_t next_seq) {
  durable_.resend_first_seq = first_seq;
  durable_.resend_next_seq = next_seq;
  heartbeat_wanted_ = true;
  flush();
}

void RobotSession::request_event_resend() {
  durable_.resend_events = true;
  heartbeat_wanted_ = true;
  flush();
}

void RobotSession::close(const std::string& reason) {
  close_reason_ = reason;
  stream_->close();
}

}  // namespace server
