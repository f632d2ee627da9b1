// Serves one robot's connection.
#include "server/link/robot_session.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <utility>

#include "server/link/greeting.hpp"
#include "server/runtime/exceptions.hpp"

namespace server::link {
namespace asio = boost::asio;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

namespace {

constexpr auto kClosedByRobot = "the robot closed the connection";
constexpr auto kUndecodedHello = "a hello that does not decode";
constexpr auto kFault = "a fault of the station; its log says which";
constexpr std::int64_t kGridUs = 4'000;  // at whose multiples sessions wake, many at once
// How long a robot is read promptly after a command to it, and after more than this came at once: it sends again what
// it could not send before, and its memory for what we have not acknowledged may be small.
constexpr std::int64_t kCommandedUs = 5'000'000, kMuchUs = 1'000'000;
constexpr std::size_t kMuchBytes = 2048;
// And after nothing had come in a quiet pause: it sends more rarely than that, so that pauses save nothing and cost a
// read each.
constexpr std::int64_t kSparseUs = 10'000'000;

}  // namespace

RobotSession::RobotSession(asio::io_context& loop, runtime::Clock& clock, std::unique_ptr<net::ByteStream> stream,
                           station::Station& station, station::RobotArchive& archive, ReadBuffers& buffers)
    : clock_{clock},
      stream_{std::move(stream)},
      station_{station},
      archive_{archive},
      buffers_{buffers},
      reading_paused_{loop},
      wake_writer_{loop},
      outbox_{std::int64_t{station.link_times().heartbeat_interval_ms} * 1000} {}

// Also of one that was never served. What is to be said of its end may fail; the end itself does not.
RobotSession::~RobotSession() {
  try {
    station_.on_disconnected(*this, "the station stops");
  } catch (const std::exception& error) {
    spdlog::error("robot '{}': {}", robot_id_, runtime::text_of(error));
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
  if (close_reason_ == kUndecodedHello) {
    const Refusal refusal = refusal_of_too_long_hello();
    co_return co_await refuse(refusal);
  }
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
    const std::exception_ptr failure = runtime::first_of(std::current_exception());
    if (runtime::is_cancellation(failure)) std::rethrow_exception(failure);
    failure_ = failure;
  }
  co_return kFault;
}

void RobotSession::read() {
  const bool is_greeted = !hello_ || !robot_id_.empty();  // what comes between the hello and the welcome, waits
  if (!is_greeted) return;
  try {
    if (!close_reason_.empty()) return reading_paused_.notify();
    const net::ByteStream::Read got = stream_->read_now(asio::buffer(buffers_.input));
    if (got.size > 0) {
      last_received_us_ = clock_.steady_us();
      if (got.size > kMuchBytes) stay_prompt(kMuchUs);
      on_bytes({buffers_.input.data(), got.size});
    } else {
      stay_prompt(kSparseUs);
    }
    if (got.has_ended && close_reason_.empty()) close_reason_ = kClosedByRobot;
    if (!robot_id_.empty()) update_read_pace();
    if (!close_reason_.empty()) reading_paused_.notify();
  } catch (...) {
    failure_ = std::current_exception();
    reading_paused_.notify();
  }
}

void RobotSession::on_bytes(protocol::Bytes unread) {
  while (close_reason_.empty() && decode_next_of(unread)) {
    if (!hello_) {
      after_hello_.assign(unread.begin(), unread.end());
      return on_hello(buffers_.frame);
    }
    on_frame(buffers_.frame);
  }
  if (!close_reason_.empty()) return reading_paused_.notify();
  outbox_.on_received(last_received_us_);
  if (!stop_path_.is_open) report_stop_path();
  if (outbox_.has_work() && !robot_id_.empty()) flush();
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
    station_.on_frame(*this,
                      0);  // SAFETY: the robot is there: what a stop's repetition and the ends of commands wait for
    station_.on_invalid_values(*this, 1, "malformed", "a frame does not decode");
  }
  close_reason_ = !hello_ && has_hello(reader_.payload()) ? kUndecodedHello : "a frame that does not decode";
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

// Checks the hello, asks the archive, and connects the robot or refuses it.
asio::awaitable<bool> RobotSession::admit(const protocol::Hello& hello) {
  std::optional<Refusal> refusal = refusal_of(hello, hello_robot_time_us_);
  if (refusal) co_return co_await refuse(*refusal);
  const std::string id = hello.robot_id;
  claimed_id_ = id;
  const auto request = admission_request(hello, hello_robot_time_us_, stream_->from_loopback(), clock_.utc_us());
  refusal = refusal_if_connected(hello);
  if (refusal) co_return co_await refuse(*refusal);
  const station::Admission admission = co_await archive_.admit(request);
  if (admission.enrolment_full) station_.on_enrolment_refused(id, stream_->peer(), admission.detail);
  refusal = refusal_of(admission);
  if (!refusal) refusal = refusal_if_connected(hello);  // another connection may have won while we asked
  if (refusal) co_return co_await refuse(*refusal);

  robot_id_ = id;
  reach_ = station::FrameReach::after(hello, hello_robot_time_us_);
  outbox_.welcome(welcome_of(admission, station_.link_times(), clock_.utc_us()));
  last_received_us_ = clock_.steady_us();
  if (hello.answers_stop_probes) outbox_.stop_probes().begin(last_received_us_);
  station_.on_connected(*this, request, hello, admission, stream_->peer());
  co_return true;
}

std::optional<Refusal> RobotSession::refusal_if_connected(const protocol::Hello& hello) const {
  const auto may_connect = station_.may_connect(hello.robot_id, hello.boot_id);
  if (may_connect) return std::nullopt;
  return Refusal{rheonaut_REFUSAL_REASON_ALREADY_CONNECTED, may_connect.error().detail};
}

asio::awaitable<bool> RobotSession::refuse(Refusal refusal) {
  close_reason_ = std::string{protocol::text(refusal.reason)} + ": " + refusal.detail;
  station_.on_refused(claimed_id_, stream_->peer(), refusal.reason, refusal.detail);
  outbox_.welcome(welcome_of(refusal));
  outbox_.write_next(clock_.steady_us(), [](protocol::Bytes) { return std::size_t{0}; });  // the stream may wait for it
  co_await stream_->write(asio::buffer(outbox_.unsent().first, outbox_.unsent().size));
  co_return false;
}

asio::awaitable<RobotSession::EndReason> RobotSession::read_frames() {
  const std::vector<std::uint8_t> first = std::move(after_hello_);
  on_bytes({first.data(), first.size()});
  stream_->on_readable([this] { read(); });
  update_read_pace();
  co_await reading_paused_.wait();
  co_return failure_ ? kFault : close_reason_;
}

void RobotSession::on_frame(protocol::RobotFrame& frame) {
  if (frame.which_body == rheonaut_RobotFrame_hello_tag) {
    close_reason_ = "a second hello on one connection";
    return;
  }
  const station::FrameFaults faults = station::mend(frame, reach_);
  if (faults.has_number) reach_.advance(frame);
  station_.on_frame(*this, frame.robot_time_us);
  if (faults.count > 0) station_.on_invalid_values(*this, faults.count, faults.cause, faults.first);
  if (faults.is_unusable) return faults.has_number ? report_unusable(frame) : void();
  if (frame.which_body != rheonaut_RobotFrame_command_ack_tag) {
    outbox_.on_robot_time(frame.robot_time_us, hello_->sample_period_us);
  }
  switch (frame.which_body) {
    case rheonaut_RobotFrame_telemetry_tag: station_.on_samples(*this, *faults.samples); break;
    case rheonaut_RobotFrame_event_tag:
      outbox_.on_event_of(
          frame.body.event.command_id);  // the answer came before the event of its command, or never will
      station_.on_event(*this, *faults.event);
      break;
    case rheonaut_RobotFrame_status_tag: station_.on_status(*this, frame.body.status); break;
    case rheonaut_RobotFrame_parameter_page_tag: station_.on_parameters(*this, frame.body.parameter_page); break;
    case rheonaut_RobotFrame_controller_tag: station_.on_controller(*this, frame.body.controller); break;
    case rheonaut_RobotFrame_command_ack_tag:
      outbox_.on_ack(frame.body.command_ack);
      station_.on_command_ack(*this, frame.body.command_ack);
      update_read_pace();
      break;
    case rheonaut_RobotFrame_stop_probe_answer_tag: on_stop_probe_answer(frame.body.stop_probe_answer); break;
    case rheonaut_RobotFrame_heartbeat_tag: on_heartbeat(frame); break;
    default: break;  // a message of a newer version
  }
}

// What cannot be recorded is lost for good, so that the robot need not send it for ever.
void RobotSession::report_unusable(const protocol::RobotFrame& frame) {
  if (frame.which_body == rheonaut_RobotFrame_event_tag) return station_.on_unusable_event(*this, frame.body.event);
  station_.on_unusable_samples(*this, frame.body.telemetry);
}

void RobotSession::on_heartbeat(const protocol::RobotFrame& frame) {
  const protocol::Heartbeat& answer = frame.body.heartbeat;
  if (!outbox_.on_probe_answer(answer.echo_station_time_us)) return;
  update_read_pace();
  station::ClockExchange exchange;
  exchange.sent_at_us = static_cast<std::int64_t>(answer.echo_station_time_us);
  exchange.received_at_robot_us = static_cast<std::int64_t>(answer.echo_received_at_robot_us);
  exchange.answered_at_robot_us = static_cast<std::int64_t>(frame.robot_time_us);
  exchange.answer_received_at_us = last_received_us_;
  station_.on_clock(*this, exchange);
}

void RobotSession::on_stop_probe_answer(const protocol::StopProbeAnswer& answer) {
  if (!outbox_.stop_probes().on_answer(answer.echo_station_time_us, last_received_us_, clock_.utc_us())) return;
  update_read_pace();
  report_stop_path();
}

void RobotSession::report_stop_path() {
  const station::StopPath& path = outbox_.stop_probes().judge(last_received_us_, clock_.steady_us());
  if (path == stop_path_) return;
  stop_path_ = path;
  station_.on_stop_path(*this, path);
}

// Carries on where flush() cannot: with a stream that takes no more for now.
asio::awaitable<RobotSession::EndReason> RobotSession::write_frames() {
  for (;;) {
    flush();
    const protocol::Bytes unsent = outbox_.unsent();
    if (unsent.empty()) {
      co_await wake_writer_.wait();
      continue;
    }
    const bool written = co_await stream_->write(asio::buffer(unsent.first, unsent.size));
    if (!written) co_return kClosedByRobot;
    outbox_.unsent_was_written();
    writing_since_us_.reset();
  }
}

// Writes what is due, in order of urgency, as far as the stream takes it at once.
void RobotSession::flush() {
  if (!outbox_.unsent().empty()) return;  // the writer goes on here
  const auto write = [this](protocol::Bytes bytes) {
    return stream_->write_now(asio::buffer(bytes.first, bytes.size));
  };
  while (const auto written = outbox_.write_next(clock_.steady_us(), write)) {
    // SAFETY: the frame first, what the station says of it afterwards.
    if (written->command_id) station_.on_command_sent(*this, *written->command_id);
    update_read_pace();
  }
  if (outbox_.unsent().empty()) return;
  writing_since_us_ = clock_.steady_us();
  wake_writer_.notify();
}

// SAFETY: the answer to an emergency stop waits behind no other robot and in no pause. Nor does that to a probe, which
// measures time. A robot that somebody watches or commands is read promptly, the others every 30 ms.
void RobotSession::update_read_pace() {
  const bool is_prompt = clock_.steady_us() < prompt_until_us_ || station_.is_attended(*this);
  const net::ReadPace unasked = is_prompt ? net::ReadPace::prompt : net::ReadPace::quiet;
  stream_->set_pace(outbox_.awaits_answer() ? net::ReadPace::awaited : unasked);
}

void RobotSession::stay_prompt(std::int64_t duration_us) {
  prompt_until_us_ = std::max(prompt_until_us_, clock_.steady_us() + duration_us);
}

// A robot that is silent, or that does not take what we write, is lost: TCP alone would notice much later.
// Heartbeats leave from here.
asio::awaitable<RobotSession::EndReason> RobotSession::watch_link() {
  const std::int64_t timeout_us = std::int64_t{station_.link_times().link_timeout_ms} * 1000;
  for (;;) {
    const std::int64_t now_us = clock_.steady_us();
    if (now_us - last_received_us_ >= timeout_us) co_return "no frame within the link time-out";
    if (writing_since_us_ && now_us - *writing_since_us_ >= timeout_us) co_return "the robot does not read";
    const StopProbes& probes = outbox_.stop_probes();
    if (now_us >= outbox_.next_heartbeat_us() || probes.is_due(now_us)) flush();
    report_stop_path();
    const std::int64_t silent_since_us = std::min(last_received_us_, writing_since_us_.value_or(last_received_us_));
    const std::int64_t lost_us = silent_since_us + timeout_us;
    const bool can_write = outbox_.unsent().empty();
    std::int64_t due_us = can_write ? std::min(lost_us, outbox_.next_heartbeat_us()) : lost_us;
    if (can_write && stop_path_.is_measured) due_us = std::min(due_us, probes.due_us());
    if (stop_path_.is_open) due_us = std::min(due_us, probes.ends_us(last_received_us_));
    co_await clock_.sleep_until((due_us + kGridUs - 1) / kGridUs * kGridUs);
  }
}

bool RobotSession::send(const protocol::Command& command, std::int64_t deadline_us) {
  if (!outbox_.enqueue(command, deadline_us)) return false;
  stay_prompt(kCommandedUs);
  wake_writer_.notify();
  return true;
}

bool RobotSession::withdraw(station::CommandId id) { return outbox_.withdraw(id); }

void RobotSession::send_emergency_stop(const protocol::Command& command) {
  outbox_.enqueue_stop(command);
  stay_prompt(kCommandedUs);
  flush();  // SAFETY: it leaves now, not when the writer resumes
}

void RobotSession::acknowledge(std::uint64_t durable_next_seq, std::uint64_t durable_next_event_seq) {
  outbox_.set_durable(durable_next_seq, durable_next_event_seq);
}

void RobotSession::request_resend(std::uint64_t first_seq, std::uint64_t next_seq) {
  outbox_.request_resend(first_seq, next_seq);
  flush();
}

void RobotSession::request_event_resend() {
  outbox_.request_event_resend();
  flush();
}

void RobotSession::close(const std::string& reason) {
  close_reason_ = reason;
  stream_->close();
}

}  // namespace server::link
