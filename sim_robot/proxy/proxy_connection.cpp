// Reads into the streams and writes what they give.
#include "sim_robot/proxy/proxy_connection.hpp"

#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/write.hpp>
#include <utility>

#include "sim_robot/client/no_throw.hpp"
#include "sim_robot/world/microseconds.hpp"

namespace sim_robot {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using namespace asio::experimental::awaitable_operators;
using namespace std::chrono_literals;

constexpr auto kConnectTimeout = 2s;
constexpr auto kCutDeadline = 1s;

}  // namespace

ProxyConnection::ProxyConnection(tcp::socket client, StationAddress target, const LinkOptions& options,
                                 std::string name, LinkLog log)
    : client_(std::move(client)),
      target_(client_.get_executor()),
      address_(std::move(target)),
      name_(std::move(name)),
      log_(std::move(log)),
      up_(client_, target_, options.up, 2 * options.seed),
      down_(target_, client_, options.down, 2 * options.seed + 1),
      deadline_(client_.get_executor()) {}

asio::awaitable<void> ProxyConnection::run() {
  boost::system::error_code ignored;
  client_.set_option(tcp::no_delay{true}, ignored);
  auto both = fill(up_) && serve_target();
  co_await std::move(both);
  close();
  log_(name_ + " ended");
}

asio::awaitable<void> ProxyConnection::serve_target() {
  while (!ended_ && now_us() < stalled_until_us_) {
    up_.wake.expires_at(stalled_until_us_ == ImpairedStream::kNever ? Clock::time_point::max() : at(stalled_until_us_));
    co_await up_.wake.async_wait(kNoThrow);
  }
  if (up_.read_all) close();  // gone while nothing could reach the target: as a dial that timed out
  if (ended_) co_return;
  const bool reached = co_await dial(target_, address_, kConnectTimeout);
  if (!reached && !ended_) {
    log_("cannot reach " + address_.host + ":" + address_.port + ": " + name_ + " is closed");
    close();
  }
  if (ended_) co_return;
  auto all = drain(up_) && fill(down_) && drain(down_);
  co_await std::move(all);
}

asio::awaitable<void> ProxyConnection::fill(Pipe& pipe) {
  std::array<std::uint8_t, 4096> bytes;
  while (!ended_) {
    const bool discards = pipe.stream.closed();  // cut: read on, so that closing later is no reset
    const std::size_t room = discards ? bytes.size() : std::min(bytes.size(), pipe.stream.room());
    if (room == 0) {
      pipe.space.expires_at(Clock::time_point::max());
      co_await pipe.space.async_wait(kNoThrow);
      continue;
    }
    const auto [error, size] = co_await pipe.from.async_read_some(asio::buffer(bytes.data(), room), kNoThrow);
    if (error) {
      on_end(pipe, error);
      break;
    }
    pipe.stream.push({bytes.data(), size}, now_us());
    pipe.wake.cancel();
  }
}

void ProxyConnection::on_end(Pipe& pipe, const boost::system::error_code& error) {
  if (ended_) return;
  pipe.read_all = true;
  const bool passes = now_us() >= stalled_until_us_ && !pipe.stream.closed();
  if (error != asio::error::eof && passes) {
    log_(name_ + " was reset");
    return reset();
  }
  pipe.stream.close(now_us());
  const bool nothing_comes = !up_.stream.next_at_us() || !down_.stream.next_at_us();
  if (up_.read_all && down_.read_all && now_us() < stalled_until_us_ && nothing_comes) return close();
  pipe.wake.cancel();
}

asio::awaitable<void> ProxyConnection::drain(Pipe& pipe) {
  std::array<std::uint8_t, 4096> bytes;
  while (!ended_) {
    const std::size_t size = pipe.stream.pull(bytes.data(), bytes.size(), now_us());
    if (size > 0) {
      pipe.space.cancel();
      const auto [error, written] = co_await asio::async_write(pipe.to, asio::buffer(bytes.data(), size), kNoThrow);
      if (error && !ended_) reset();
      continue;
    }
    if (pipe.stream.ended(now_us())) break;
    const auto next_us = pipe.stream.next_at_us();
    pipe.wake.expires_at(next_us ? at(*next_us) : Clock::time_point::max());
    co_await pipe.wake.async_wait(kNoThrow);
  }
  boost::system::error_code ignored;
  if (!ended_) pipe.to.shutdown(tcp::socket::shutdown_send, ignored);
}

void ProxyConnection::stall(double for_s) {
  stalled_until_us_ = end_us(now_us(), for_s);
  for (Pipe* pipe : {&up_, &down_}) pipe->stream.stall(now_us(), stalled_until_us_);
  wake_all();
}

void ProxyConnection::half_open(Direction direction) {
  stalled_until_us_ = ImpairedStream::kNever;
  if (direction != Direction::down) up_.stream.stall(now_us(), ImpairedStream::kNever);
  if (direction != Direction::up) down_.stream.stall(now_us(), ImpairedStream::kNever);
  wake_all();
}

void ProxyConnection::resume() {
  stalled_until_us_ = 0;
  for (Pipe* pipe : {&up_, &down_}) pipe->stream.resume(now_us());
  wake_all();
}

void ProxyConnection::impair(const Impairment& up, const Impairment& down) {
  up_.stream.impair(up, now_us());
  down_.stream.impair(down, now_us());
  wake_all();
}

void ProxyConnection::cut(std::size_t after_bytes) {
  const bool is_in_outage = stalled_until_us_ > now_us() && stalled_until_us_ != ImpairedStream::kNever;
  if (!is_in_outage) resume();
  for (Pipe* pipe : {&up_, &down_}) pipe->stream.cut(after_bytes, now_us());
  wake_all();
  deadline_.expires_at((is_in_outage ? at(stalled_until_us_) : Clock::now()) + kCutDeadline);
  deadline_.async_wait([self = weak_from_this()](const boost::system::error_code& error) {
    const auto connection = error ? nullptr : self.lock();
    if (connection) connection->close();
  });
}

void ProxyConnection::reset() {
  boost::system::error_code ignored;
  for (tcp::socket* socket : {&client_, &target_}) {
    socket->set_option(asio::socket_base::linger{true, 0}, ignored);
  }
  close();
}

void ProxyConnection::close() {
  ended_ = true;
  boost::system::error_code ignored;
  client_.close(ignored);
  target_.close(ignored);
  deadline_.cancel();
  wake_all();
}

void ProxyConnection::wake_all() {
  for (Pipe* pipe : {&up_, &down_}) {
    pipe->wake.cancel();
    pipe->space.cancel();
  }
}

std::uint64_t ProxyConnection::now_us() const {
  const auto since = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - began_at_);
  return static_cast<std::uint64_t>(since.count());
}

}  // namespace sim_robot
