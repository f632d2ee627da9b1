// Dials, reads and writes.
#include "sim_robot/station_connection.hpp"

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/connect.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/steady_timer.hpp>
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
constexpr auto kMayDialPeriod = 10ms;
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

StationConnection::StationConnection(asio::io_context& loop, Speaker& speaker, StationAddress station, std::string name,
                                     LinkLog log)
    : speaker_(speaker), station_(std::move(station)), name_(std::move(name)), log_(std::move(log)), socket_(loop) {}

asio::awaitable<void> StationConnection::run() {
  for (;;) {
    while (!speaker_.may_dial()) co_await pause(kMayDialPeriod);
    const int times_forgotten = times_forgotten_;
    const bool dialled = co_await dial();
    if (!dialled) {
      ++counts_.unreachable;
      say("cannot reach the station at " + station_.host + ":" + station_.port + ", trying again");
    } else {
      const bool ready = co_await shake_hands();
      if (ready && times_forgotten == times_forgotten_) {
        co_await serve();
        say_how_it_ended();
      }
    }
    std::uniform_int_distribution<int> pause_ms{kMinPauseMs, kMaxPauseMs};
    co_await pause(std::chrono::milliseconds(pause_ms(jitter_)));
  }
}

// An address in numbers needs no resolver, which would serve a fleet one by one.
asio::awaitable<bool> StationConnection::dial() {
  boost::system::error_code error;
  const auto address = asio::ip::make_address(station_.host, error);
  std::vector<tcp::endpoint> endpoints;
  if (!error) {
    endpoints.emplace_back(address, static_cast<std::uint16_t>(std::stoi(station_.port)));
  } else {
    tcp::resolver resolver{socket_.get_executor()};
    auto resolving = resolver.async_resolve(station_.host, station_.port, kNoThrow) || pause(kConnectTimeout);
    auto resolved = co_await std::move(resolving);
    if (resolved.index() == 1) co_return false;
    const auto [resolve_error, results] = std::get<0>(resolved);
    if (resolve_error) co_return false;
    endpoints.assign(results.begin(), results.end());
  }
  co_return co_await reach(std::move(endpoints));
}

asio::awaitable<bool> StationConnection::reach(std::vector<tcp::endpoint> endpoints) {
  socket_ = tcp::socket{socket_.get_executor()};
  auto connecting = asio::async_connect(socket_, endpoints, kNoThrow) || pause(kConnectTimeout);
  auto outcome = co_await std::move(connecting);
  if (outcome.index() == 1 || std::get<0>(std::get<0>(outcome))) co_return false;
  boost::system::error_code error;
  socket_.set_option(tcp::no_delay{true}, error);
  socket_.non_blocking(true, error);
  co_return !error;
}

asio::awaitable<bool> StationConnection::shake_hands() {
  const auto handshake = speaker_.begin_handshake();
  if (handshake && *handshake > 0ms) co_await pause(*handshake);
  co_return handshake.has_value();
}

// Bytes go to the speaker as they arrive, and what it answers leaves at once.
asio::awaitable<void> StationConnection::serve() {
  is_open_ = true;
  was_welcome_ = false;
  unsent_.clear();
  speaker_.on_opened();
  if (is_open_) flush();
  while (is_open_) {
    const auto [error] = co_await socket_.async_wait(tcp::socket::wait_read, kNoThrow);
    if (error) break;
    const bool keep = take_bytes();
    if (!keep) break;
  }
  close();
}

// The wait came before, so that nothing lies in the buffer but what is handed on at once: all connections share it.
bool StationConnection::take_bytes() {
  thread_local std::array<std::uint8_t, 4096> bytes;
  boost::system::error_code error;
  const std::size_t size = socket_.read_some(asio::buffer(bytes), error);
  if (error == asio::error::would_block) return true;
  if (error) return false;
  const bool keep = speaker_.on_bytes({bytes.data(), size});
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

void StationConnection::flush() {
  if (is_open_ && !unsent_.empty()) {
    const auto rest = std::exchange(unsent_, {});
    if (!write({rest.data(), rest.size()})) return;
  }
  std::array<std::uint8_t, protocol::kMaxFramedBytes> frame;
  while (is_open_) {
    const std::size_t size = speaker_.next_frame(frame.data(), frame.size());
    if (size == 0) return;
    ++counts_.frames;
    if (!write({frame.data(), size})) return;
  }
}

// True when all of it was taken; keeps the rest otherwise.
bool StationConnection::write(protocol::Bytes bytes) {
  boost::system::error_code error;
  bytes.drop(socket_.write_some(asio::buffer(bytes.first, bytes.size), error));
  if (error && error != asio::error::would_block) {
    close();
    return false;
  }
  unsent_.assign(bytes.begin(), bytes.end());
  return bytes.empty();
}

// SAFETY: the silence may be the robot's own, after a stall; a stop that came meanwhile is read before the verdict.
void StationConnection::close_as_silent() {
  boost::system::error_code ignored;
  if (!is_open_ || socket_.available(ignored) > 0) return;
  say("the station is silent");
  close();
}

// Also ends the read under way, as close() does.
void StationConnection::forget() {
  ++times_forgotten_;
  boost::system::error_code ignored;
  socket_.cancel(ignored);
  if (is_open_) forgotten_.emplace(std::move(socket_));
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
  boost::system::error_code ignored;
  socket_.close(ignored);
}

void StationConnection::say_how_it_ended() {
  if (speaker_.refusal() != rheonaut_REFUSAL_REASON_NONE) {
    ++counts_.refusals;
    const std::string detail = speaker_.refusal_detail();
    say("refused by the station: " + std::string(protocol::text(speaker_.refusal())) +
        (detail.empty() ? "" : " (" + detail + ")"));
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
