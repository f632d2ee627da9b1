// Dials, reads and writes.
#include "sim_robot/client/station_connection.hpp"

#include <algorithm>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <utility>

namespace sim_robot {
namespace {

namespace asio = boost::asio;
using namespace std::chrono_literals;

using Clock = std::chrono::steady_clock;

constexpr auto kAskAgain = 10ms;
constexpr std::chrono::milliseconds kShortestPause{10};  // after an attempt that took long

}  // namespace

StationConnection::StationConnection(asio::io_context& loop, Speaker& speaker, StationAddress station, std::string name,
                                     LinkLog log)
    : speaker_(speaker), station_(std::move(station)), name_(std::move(name)), log_(std::move(log)), socket_(loop) {}

asio::awaitable<void> StationConnection::run() {
  for (;;) {
    while (!speaker_.may_dial()) co_await pause(kAskAgain);
    const int times_forgotten = times_forgotten_;
    was_welcome_ = false;
    auto pause_from = Clock::now();
    const std::string failure = co_await socket_.reach(station_, Redial::kConnectTimeout);
    if (!failure.empty()) {
      ++counts_.unreachable;
      say(failure + " at " + station_.host + ":" + station_.port + ", trying again");
    } else {
      const bool ready = co_await shake_hands();
      if (ready && times_forgotten == times_forgotten_) {
        co_await serve();
        say_how_it_ended();
      }
      pause_from = Clock::now();
    }
    if (was_welcome_) redial_.welcomed();
    const auto elapsed = std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - pause_from);
    const auto left = redial_.next(jitter_, speaker_.ring_has_room()) - elapsed;
    co_await pause(std::max(left, kShortestPause));
  }
}

asio::awaitable<bool> StationConnection::shake_hands() {
  const auto handshake = speaker_.begin_handshake();
  if (handshake && *handshake > 0ms) co_await pause(*handshake);
  co_return handshake.has_value();
}

// Bytes go to the speaker as they arrive, and what it answers leaves at once.
asio::awaitable<void> StationConnection::serve() {
  is_open_ = true;
  ++counts_.opened;
  was_welcome_ = false;
  frame_size_ = frame_sent_ = 0;
  speaker_.on_opened();
  if (is_open_) flush();
  while (is_open_) {
    const bool readable = co_await socket_.wait_readable();
    if (!readable) break;
    while (is_open_ && !speaker_.is_listening()) co_await pause(kAskAgain);
    if (!is_open_) break;
    const bool keep = take_bytes();
    if (!keep) break;
  }
  close();
}

// The wait came before, so that nothing lies in the buffer but what is handed on at once: all connections share it.
bool StationConnection::take_bytes() {
  thread_local std::array<std::uint8_t, 4096> bytes;
  const base::Wire::Attempt read = socket_.read(bytes.data(), bytes.size());
  if (read.size == 0) return !read.has_ended();
  const bool keep = speaker_.on_bytes({bytes.data(), read.size});
  flush();
  notice_welcome();
  return keep;
}

void StationConnection::notice_welcome() {
  if (was_welcome_ || !speaker_.is_welcome()) return;
  was_welcome_ = true;
  ++counts_.welcomes;
  say("connected to " + station_.host + ":" + station_.port + " as " + name_);
}

bool StationConnection::prepare() {
  if (!is_open_) return false;
  if (frame_sent_ < frame_size_) return true;
  const std::size_t size = speaker_.next_frame(frame_.data(), frame_.size());
  if (size == 0) return false;
  frame_size_ = size;
  frame_sent_ = 0;
  ++counts_.frames;
  return true;
}

void StationConnection::flush() {
  while (prepare()) {
    if (!write()) return;
  }
}

// True when all of it was taken; keeps the rest otherwise.
bool StationConnection::write() {
  const base::Wire::Attempt written = socket_.write({frame_.data() + frame_sent_, frame_size_ - frame_sent_});
  frame_sent_ += written.size;
  if (written.has_ended()) close();
  return is_open_ && frame_sent_ == frame_size_;
}

// SAFETY: the silence may be the robot's own, after a stall; a stop that came meanwhile is read before the verdict.
void StationConnection::close_as_silent() {
  if (!is_open_ || socket_.has_unread()) return;
  say("the station is silent");
  close();
}

// Also ends the read under way, as close() does.
void StationConnection::forget() {
  ++times_forgotten_;
  socket_.cancel();
  reset_forgotten();
  if (is_open_) forgotten_.emplace(socket_.take());
  is_open_ = false;
}

void StationConnection::reset_forgotten() {
  if (!forgotten_) return;
  boost::system::error_code ignored;
  forgotten_->set_option(asio::socket_base::linger{true, 0}, ignored);
  forgotten_.reset();
}

void StationConnection::close() {
  if (!is_open_) return;
  is_open_ = false;
  speaker_.on_closed();
  socket_.close();
}

void StationConnection::say_how_it_ended() {
  if (speaker_.refusal() != rheonaut_REFUSAL_REASON_NONE) {
    ++counts_.refusals;
    const std::string detail = speaker_.refusal_detail();
    refusal_ = std::string(protocol::text(speaker_.refusal())) + (detail.empty() ? "" : " (" + detail + ")");
    say("refused by the station: " + refusal_);
  } else {
    say(was_welcome_ ? "connection lost, dialling again" : "the station closed the connection before its welcome");
  }
}

// Says each thing once, however often it happens in a row.
void StationConnection::say(const std::string& line) {
  if (!log_) return;
  if (line != last_line_) log_(line);
  last_line_ = line;
}

}  // namespace sim_robot
