// Ticks by the host's clock.
#include "sim_robot/client/robot_client.hpp"

#include <algorithm>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <utility>

namespace sim_robot {

namespace asio = boost::asio;
using namespace asio::experimental::awaitable_operators;  // NOLINT: operators only
using namespace std::chrono_literals;

RobotClient::RobotClient(asio::io_context& loop, SimulatedRobotConfig config, StationAddress station, LinkLog log,
                         std::chrono::milliseconds handshake, std::vector<TimedFault> faults, FaultyLink* link)
    : life_(std::move(config)),
      handshake_(handshake),
      faults_(std::move(faults), log),
      link_(link),
      booted_at_(Clock::now()),
      connection_(loop, *this, std::move(station), life_.robot().config().robot_id, std::move(log)) {}

asio::awaitable<void> RobotClient::run() {
  boot(Clock::now());
  co_await (tick_for_ever() && stay_connected());
}

asio::awaitable<void> RobotClient::tick_for_ever() {
  asio::steady_timer timer{co_await asio::this_coro::executor};
  for (;;) {
    timer.expires_at(next_tick_at());
    co_await timer.async_wait(asio::use_awaitable);
    if (tick()) send();
  }
}

RobotClient::Clock::time_point RobotClient::next_tick_at() const {
  const std::uint64_t next_us = std::min(life_.next_tick_us(), life_.true_us() + SimulatedRobot::kPeriodUs);
  return booted_at_ + std::chrono::microseconds(next_us);
}

bool RobotClient::tick() {
  const std::uint64_t now_us = catch_up();
  if (life_.is_on()) connection_.reset_forgotten();
  watch_gaps();
  if (!connection_.is_open() || life_.is_blocked()) return false;
  if (life_.core().connection_is_silent(now_us)) connection_.close_as_silent();
  return connection_.prepare();
}

// Runs the ticks that are due and returns the robot's time, which lies before the next of them.
// SAFETY: this is the only way to a time here, so that what waited in a stopped process is judged by the time it is
// now.
std::uint64_t RobotClient::catch_up() {
  const auto since = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - booted_at_);
  faults_.advance(faulty(), static_cast<std::uint64_t>(since.count()));
  follow_reboot();
  return life_.robot_clock_us();
}

void RobotClient::reboot(const Reboot& reboot) {
  catch_up();
  life_.reboot(reboot);
  follow_reboot();
}

// The new boot knows nothing of the connection.
void RobotClient::follow_reboot() {
  if (life_.boots() == boots_) return;
  boots_ = life_.boots();
  connection_.forget();
  if (life_.lost_at_reboot() > 0) ++gaps_;
  lost_before_ = 0;
  oldest_after_gap_ = UINT64_MAX;
}

bool RobotClient::ring_has_room() const { return life_.core().samples().fill() < robot_fw::TelemetryRing::kCapacity; }

// SAFETY: while a handshake blocks the loop nothing could stop a motor.
bool RobotClient::may_dial() const { return !life_.is_blocked() && (handshake_ == 0ms || life_.core().at_rest()); }

// Empty when the robot has begun to move meanwhile.
std::optional<std::chrono::milliseconds> RobotClient::begin_handshake() {
  if (handshake_ == 0ms) return 0ms;
  catch_up();
  if (!may_dial()) return std::nullopt;
  life_.block(std::chrono::duration<double>(handshake_).count());
  return handshake_;
}

// Time passes in catch_up(), and with it the connection may be forgotten.
void RobotClient::on_opened() {
  const std::uint64_t now_us = catch_up();
  if (connection_.is_open()) life_.robot().link_opened(now_us);
}

bool RobotClient::on_bytes(protocol::Bytes bytes) {
  const std::uint64_t now_us = catch_up();
  return connection_.is_open() && life_.robot().receive(bytes, now_us);
}

// Counts the samples in the frame by how far it moves the outbox, which skips first what the ring no longer holds.
std::size_t RobotClient::next_frame(std::uint8_t* out, std::size_t capacity) {
  const std::uint64_t now_us = catch_up();
  if (!connection_.is_open() || life_.is_blocked()) return 0;
  const robot_fw::Outbox& outbox = life_.core().outbox();
  const std::uint64_t oldest = life_.core().samples().oldest_seq();
  const std::uint64_t live = std::max(outbox.live_seq(), oldest);
  const std::uint64_t backfill = std::max(outbox.backfill().next_seq, oldest);
  const std::size_t size = life_.robot().transmit(out, capacity, now_us);
  const std::uint64_t again = std::max(outbox.backfill().next_seq, backfill) - backfill;
  resent_ += again;
  sent_ += again + std::max(outbox.live_seq(), live) - live;
  return size;
}

// A gap grows as long as nothing is acknowledged: then only losses move the oldest sample.
void RobotClient::watch_gaps() {
  const robot_fw::TelemetryRing& ring = life_.core().samples();
  if (ring.lost() == lost_before_) return;
  const std::uint64_t lost_now = ring.lost() - lost_before_;
  if (ring.oldest_seq() - lost_now != oldest_after_gap_) ++gaps_;
  oldest_after_gap_ = ring.oldest_seq();
  lost_before_ = ring.lost();
}

SampleCounts RobotClient::samples() const {
  const robot_fw::TelemetryRing& ring = life_.core().samples();
  const EarlierBoots& earlier = life_.earlier_boots();
  SampleCounts counts;
  counts.made = earlier.samples_made + ring.next_seq();
  counts.held = ring.fill();
  counts.lost = earlier.samples_lost + ring.lost();
  counts.acknowledged = counts.made - counts.held - counts.lost;
  counts.gaps = gaps_;
  counts.sent = sent_;
  counts.resent = resent_;
  counts.commands = earlier.commands + life_.core().commands_received();
  counts.missed_ticks = earlier.missed_ticks + robot().missed_ticks();
  return counts;
}

}  // namespace sim_robot
