// Ticks by the host's clock.
#include "sim_robot/robot_client.hpp"

#include <algorithm>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <utility>

namespace sim_robot {

namespace asio = boost::asio;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only

RobotClient::RobotClient(asio::io_context& loop, SimulatedRobotConfig config, StationAddress station, LinkLog log)
    : robot_(std::move(config)),
      booted_at_(Clock::now()),
      connection_(loop, *this, std::move(station), robot_.config().robot_id, std::move(log)) {}

asio::awaitable<void> RobotClient::run() {
  boot(Clock::now());
  co_await (tick_for_ever() && stay_connected());
}

asio::awaitable<void> RobotClient::tick_for_ever() {
  asio::steady_timer timer{co_await asio::this_coro::executor};
  for (;;) {
    timer.expires_at(next_tick_at());
    co_await timer.async_wait(asio::use_awaitable);
    tick();
    send();
  }
}

void RobotClient::tick() {
  catch_up();
  watch_gaps();
}

void RobotClient::send() {
  if (!connection_.is_open()) return;
  connection_.flush();
  if (robot_.core().connection_is_silent(catch_up())) connection_.close_as_silent();
}

// Counts the samples in the frame by how far it moves the outbox, which skips first what the ring no longer holds.
std::size_t RobotClient::next_frame(std::uint8_t* out, std::size_t capacity) {
  const std::uint64_t now_us = catch_up();
  const robot_fw::Outbox& outbox = robot_.core().outbox();
  const std::uint64_t oldest = robot_.core().samples().oldest_seq();
  const std::uint64_t live = std::max(outbox.live_seq(), oldest);
  const std::uint64_t backfill = std::max(outbox.backfill().next_seq, oldest);
  const std::size_t size = robot_.transmit(out, capacity, now_us);
  const std::uint64_t again = std::max(outbox.backfill().next_seq, backfill) - backfill;
  resent_ += again;
  sent_ += again + std::max(outbox.live_seq(), live) - live;
  return size;
}

// A gap grows as long as nothing is acknowledged: then only losses move the oldest sample.
void RobotClient::watch_gaps() {
  const robot_fw::TelemetryRing& ring = robot_.core().samples();
  if (ring.lost() == lost_before_) return;
  const std::uint64_t lost_now = ring.lost() - lost_before_;
  if (ring.oldest_seq() - lost_now != oldest_after_gap_) ++gaps_;
  oldest_after_gap_ = ring.oldest_seq();
  lost_before_ = ring.lost();
}

SampleCounts RobotClient::samples() const {
  const robot_fw::TelemetryRing& ring = robot_.core().samples();
  SampleCounts counts;
  counts.made = ring.next_seq();
  counts.held = ring.fill();
  counts.lost = ring.lost();
  counts.acknowledged = counts.made - counts.held - counts.lost;
  counts.gaps = gaps_;
  counts.sent = sent_;
  counts.resent = resent_;
  counts.commands = robot_.core().commands_received();
  counts.missed_ticks = robot_.missed_ticks();
  return counts;
}

// Runs the ticks that are due and returns the true robot time, which lies before the next of them.
// SAFETY: this is the only way to a time here, so that what waited in a stopped process is judged by the time it is
// now.
std::uint64_t RobotClient::catch_up() {
  for (;;) {
    const auto since_boot = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - booted_at_);
    const auto now_us = static_cast<std::uint64_t>(since_boot.count());
    if (now_us < robot_.robot_time_us()) return now_us;
    robot_.advance_to(now_us);
  }
}

}  // namespace sim_robot
