// Ticks, dials, reads and writes.
#include "sim_robot/robot_client.hpp"

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/connect.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <chrono>
#include <stdexcept>
#include <utility>

namespace sim_robot {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using namespace asio::experimental::awaitable_operators;
using namespace std::chrono_literals;

constexpr auto kConnectTimeout = 1s;
constexpr auto kTick = 10ms;
constexpr int kMinPauseMs = 300, kMaxPauseMs = 900;  // between two attempts
constexpr auto kNoThrow = asio::as_tuple(asio::use_awaitable);

asio::awaitable<void> pause(std::chrono::milliseconds duration) {
  asio::steady_timer timer{co_await asio::this_coro::executor, duration};
  co_await timer.async_wait(asio::use_awaitable);
}

}  // namespace

StationAddress parse_station_address(const std::string& text, const std::string& option, int lowest_port) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == text.size()) {
    throw std::invalid_argument(option + ": '" + text + "' is not ADDR:PORT");
  }
  std::string host = text.substr(0, colon);
  if (host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  const std::string port = text.substr(colon + 1);
  if (port.size() > 5 || port.find_first_not_of("0123456789") != std::string::npos || std::stoi(port) > 65535 ||
      std::stoi(port) < lowest_port) {
    throw std::invalid_argument(option + ": '" + port + "' is not a port");
  }
  return {host, port};
}

RobotClient::RobotClient(asio::io_context& loop, SimulatedRobotConfig config, StationAddress station, LinkLog log,
                         std::chrono::milliseconds handshake, std::vector<TimedFault> faults)
    : life_(std::move(config)),
      station_(std::move(station)),
      log_(std::move(log)),
      handshake_(handshake),
      faults_(std::move(faults), log_),
      socket_(loop),
      tick_timer_(loop),
      booted_at_(Clock::now()) {}

asio::awaitable<void> RobotClient::run() {
  booted_at_ = Clock::now();
  co_await (tick() && stay_connected());
}

// Runs the ticks that are due and returns the robot's time, which lies before the next of them.
// SAFETY: this is the only way to a time here, so that what waited in a stopped process is judged by the time it is
// now.
std::uint64_t RobotClient::catch_up() {
  const auto since = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - booted_at_);
  faults_.advance(faulty(), static_cast<std::uint64_t>(since.count()));
  return life_.robot_clock_us();
}

asio::awaitable<void> RobotClient::tick() {
  for (;;) {
    tick_timer_.expires_at(booted_at_ + std::chrono::microseconds(life_.next_tick_us()));
    co_await tick_timer_.async_wait(asio::use_awaitable);
    catch_up();
    if (forgotten_ && life_.is_on()) forget_connection();
    flush();
    close_if_silent();
  }
}

// SAFETY: after a stall the silence may be the robot's own; a stop that came meanwhile is read before the verdict.
void RobotClient::close_if_silent() {
  if (!connected_ || !life_.core().connection_is_silent(catch_up())) return;
  boost::system::error_code ignored;
  if (socket_.available(ignored) > 0) return;
  say("the station is silent");
  close_connection();
}

asio::awaitable<void> RobotClient::stay_connected() {
  for (;;) {
    while (!may_dial()) co_await pause(kTick);
    const int boot = life_.boots();
    const bool dialled = co_await dial();
    if (!dialled) {
      say("cannot reach the station at " + station_.host + ":" + station_.port + ", trying again");
    } else {
      const bool ready = co_await shake_hands();
      if (ready && boot == life_.boots()) {
        co_await serve();
        say_how_it_ended();
      }
    }
    std::uniform_int_distribution<int> pause_ms{kMinPauseMs, kMaxPauseMs};
    co_await pause(std::chrono::milliseconds(pause_ms(jitter_)));
  }
}

// SAFETY: while a handshake blocks the loop nothing could stop a motor.
bool RobotClient::may_dial() const { return !life_.is_blocked() && (handshake_ == 0ms || life_.core().at_rest()); }

// False when the robot has begun to move meanwhile.
asio::awaitable<bool> RobotClient::shake_hands() {
  if (handshake_ == 0ms) co_return true;
  catch_up();
  if (!may_dial()) co_return false;
  life_.block(std::chrono::duration<double>(handshake_).count());
  co_await pause(handshake_);
  co_return true;
}

void RobotClient::reboot(const Reboot& reboot) {
  catch_up();
  life_.reboot(reboot);
  boost::system::error_code ignored;
  socket_.cancel(ignored);
  if (connected_) forgotten_.emplace(std::move(socket_));
  connected_ = false;
}

void RobotClient::forget_connection() {
  boost::system::error_code ignored;
  forgotten_->set_option(asio::socket_base::linger{true, 0}, ignored);
  forgotten_.reset();
}

asio::awaitable<bool> RobotClient::dial() {
  socket_ = tcp::socket{socket_.get_executor()};
  tcp::resolver resolver{socket_.get_executor()};
  auto resolving = resolver.async_resolve(station_.host, station_.port, kNoThrow) || pause(kConnectTimeout);
  auto resolved = co_await std::move(resolving);
  if (resolved.index() == 1) co_return false;
  const auto [resolve_error, endpoints] = std::get<0>(resolved);
  if (resolve_error) co_return false;
  auto connecting = asio::async_connect(socket_, endpoints, kNoThrow) || pause(kConnectTimeout);
  auto outcome = co_await std::move(connecting);
  if (outcome.index() == 1 || std::get<0>(std::get<0>(outcome))) co_return false;
  boost::system::error_code error;
  socket_.set_option(tcp::no_delay{true}, error);
  socket_.non_blocking(true, error);
  co_return !error;
}

// Bytes go to the robot as they arrive, and what it answers leaves at once.
asio::awaitable<void> RobotClient::serve() {
  connected_ = true;
  was_up_ = false;
  frame_size_ = frame_sent_ = 0;
  life_.robot().link_opened(catch_up());
  flush();
  std::array<std::uint8_t, 4096> bytes;
  while (connected_) {
    const auto [error, size] = co_await socket_.async_read_some(asio::buffer(bytes), kNoThrow);
    if (error) break;
    const bool keep = life_.robot().receive({bytes.data(), size}, catch_up());
    flush();
    if (!was_up_ && life_.core().link_up()) {
      was_up_ = true;
      say("connected to " + station_.host + ":" + station_.port + " as " + life_.robot().config().robot_id);
    }
    if (!keep) break;
  }
  close_connection();
}

// Hands the socket what it takes without waiting, one write per frame.
void RobotClient::flush() {
  while (connected_) {
    if (frame_sent_ == frame_size_) {
      frame_size_ = life_.robot().transmit(frame_.data(), frame_.size(), catch_up());
      frame_sent_ = 0;
      if (frame_size_ == 0) return;
    }
    boost::system::error_code error;
    frame_sent_ += socket_.write_some(asio::buffer(frame_.data() + frame_sent_, frame_size_ - frame_sent_), error);
    if (error == asio::error::would_block) return;
    if (error) return close_connection();
  }
}

// Also ends the read under way.
void RobotClient::close_connection() {
  if (!connected_) return;
  connected_ = false;
  life_.robot().link_closed(catch_up());
  boost::system::error_code ignored;
  socket_.close(ignored);
}

void RobotClient::say_how_it_ended() {
  const robot_fw::Robot& core = life_.core();
  if (core.refusal() != rheonaut_REFUSAL_REASON_NONE) {
    const std::string detail = core.refusal_detail();
    say("refused by the station: " + std::string(protocol::text(core.refusal())) +
        (detail.empty() ? "" : " (" + detail + ")"));
  } else {
    say(was_up_ ? "connection lost, dialling again" : "the station closed the connection before its welcome");
  }
}

// Says each thing once, however often it happens in a row.
void RobotClient::say(const std::string& line) {
  if (line != last_line_) log_(line);
  last_line_ = line;
}

}  // namespace sim_robot
