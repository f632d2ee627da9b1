// Dials, moves bytes, and applies the faults.
#include "sim_robot/lab/impaired_link.hpp"

#include <array>

#include "sim_robot/world/microseconds.hpp"

namespace sim_robot {
namespace {

constexpr std::uint64_t kConnectTimeoutUs = std::chrono::microseconds(Redial::kConnectTimeout).count();

}  // namespace

ImpairedLink::ImpairedLink(RobotLife& robot, const LinkOptions& options)
    : robot_(robot),
      made_with_{options.up, options.down},
      impairments_(made_with_),
      handshake_s_(options.handshake_s),
      random_(options.seed),
      boots_(robot.boots()) {
  check(options.up);
  check(options.down);
}

void ImpairedLink::step() {
  exchange();  // what the station has said since arrives before the next tick
  robot_.advance_to(now_us() + kStepUs);
  exchange();
}

void ImpairedLink::exchange() {
  follow_reboot();
  end_outage();
  if (robot_.is_blocked()) return;
  if (phase_ != Phase::open) dial();
  if (phase_ == Phase::open) {
    read();
    write();
  }
  answer_the_dead();
}

// A robot that has lost its power says nothing: the station's end stays open.
void ImpairedLink::follow_reboot() {
  if (robot_.boots() == boots_) return;
  boots_ = robot_.boots();
  phase_ = Phase::idle;
  phase_ends_us_ = now_us();
}

void ImpairedLink::end_outage() {
  if (now_us() < outage_until_us_ || !reset_after_outage_) return;
  reset_after_outage_ = false;
  reset();
}

void ImpairedLink::dial() {
  if (now_us() < phase_ends_us_) return;
  const bool reachable = now_us() >= outage_until_us_;
  switch (phase_) {
    case Phase::open: break;
    case Phase::idle:
      // SAFETY: while the handshake blocks the loop nothing could stop a motor.
      if (handshake_s_ > 0 && !robot_.core().at_rest()) break;
      if (!reachable) return pause_for_at_least(kConnectTimeoutUs);
      phase_ = Phase::dialling;
      phase_ends_us_ = now_us() + microseconds(impairments_.up.delay_s + impairments_.down.delay_s);
      break;
    case Phase::dialling:
      if (!reachable) return pause_for_at_least(kConnectTimeoutUs);
      if (handshake_s_ <= 0) return open();
      if (!robot_.core().at_rest()) break;
      phase_ = Phase::handshake;
      robot_.block(handshake_s_);
      break;
    case Phase::handshake: return reachable ? open() : pause_for_at_least(0);
  }
}

void ImpairedLink::open() {
  connection_.emplace(ImpairedStream{impairments_.up, random_()}, ImpairedStream{impairments_.down, random_()});
  ++connections_;
  unsent_.clear();
  phase_ = Phase::open;
  robot_.robot().link_opened(robot_.robot_clock_us());
}

// SAFETY: what has arrived, a stop for one, is read before the silence is judged.
void ImpairedLink::read() {
  std::array<std::uint8_t, 1460> bytes;
  const std::uint64_t clock_us = robot_.robot_clock_us();
  while (const std::size_t size = connection_->down.pull(bytes.data(), bytes.size(), now_us())) {
    const bool keep = robot_.robot().receive({bytes.data(), size}, clock_us);
    if (!keep) return hang_up(true);
  }
  if (connection_->down.ended(now_us()) || robot_.core().connection_is_silent(clock_us)) hang_up(true);
}

void ImpairedLink::write() {
  std::array<std::uint8_t, protocol::kMaxFramedBytes> frame;
  while (phase_ == Phase::open) {
    const std::size_t taken = connection_->up.push({unsent_.data(), unsent_.size()}, now_us());
    unsent_.erase(unsent_.begin(), unsent_.begin() + static_cast<std::ptrdiff_t>(taken));
    if (!unsent_.empty()) return;
    const std::size_t size = robot_.robot().transmit(frame.data(), frame.size(), robot_.robot_clock_us());
    if (size == 0) return;
    unsent_.assign(frame.data(), frame.data() + size);
  }
}

void ImpairedLink::hang_up(bool says_so) {
  if (phase_ != Phase::open) return;
  if (says_so) connection_->up.close(now_us());
  if (robot_.core().link_up()) redial_.welcomed();
  robot_.robot().link_closed(robot_.robot_clock_us());
  pause_for_at_least(0);
}

// Bytes that reach a robot without this connection are answered with a reset.
void ImpairedLink::answer_the_dead() {
  if (phase_ == Phase::open || !is_open()) return;
  std::uint8_t ignored = 0;
  if (connection_->down.pull(&ignored, 1, now_us()) > 0) connection_->station_is_open = false;
}

void ImpairedLink::pause_for_at_least(std::uint64_t duration_us) {
  const bool ring_has_room = robot_.core().samples().fill() < robot_fw::TelemetryRing::kCapacity;
  const std::chrono::microseconds pause = redial_.next(random_, ring_has_room);
  phase_ = Phase::idle;
  phase_ends_us_ = now_us() + std::max(duration_us, static_cast<std::uint64_t>(pause.count()));
}

std::size_t ImpairedLink::send(protocol::Bytes bytes) {
  return is_open() ? connection_->down.push(bytes, now_us()) : 0;
}

std::size_t ImpairedLink::receive(std::uint8_t* out, std::size_t capacity) {
  if (!is_open()) return 0;
  const std::size_t size = connection_->up.pull(out, capacity, now_us());
  if (size == 0 && connection_->up.ended(now_us())) close();
  return size;
}

void ImpairedLink::close() {
  if (!is_open()) return;
  connection_->down.close(now_us());
  connection_->station_is_open = false;
}

void ImpairedLink::outage(double for_s, bool then_reset) {
  outage_until_us_ = end_us(now_us(), for_s);
  reset_after_outage_ = then_reset;
  if (!connection_) return;
  connection_->up.stall(now_us(), outage_until_us_);
  connection_->down.stall(now_us(), outage_until_us_);
}

void ImpairedLink::half_open(Direction direction) {
  if (!connection_) return;
  if (direction != Direction::down) connection_->up.stall(now_us(), ImpairedStream::kNever);
  if (direction != Direction::up) connection_->down.stall(now_us(), ImpairedStream::kNever);
}

void ImpairedLink::cut(std::size_t after_bytes) {
  if (!connection_) return;
  connection_->up.cut(after_bytes, now_us());
  connection_->down.cut(after_bytes, now_us());
}

void ImpairedLink::reset() {
  follow_reboot();  // the robot's end may be gone already
  if (connection_) connection_->station_is_open = false;
  hang_up(false);
}

void ImpairedLink::resume() {
  outage_until_us_ = 0;
  reset_after_outage_ = false;
  if (!connection_) return;
  connection_->up.resume(now_us());
  connection_->down.resume(now_us());
}

void ImpairedLink::impair(const Impairment& up, const Impairment& down) {
  check(up);
  check(down);
  impairments_.up = up;
  impairments_.down = down;
  if (!connection_) return;
  connection_->up.impair(up, now_us());
  connection_->down.impair(down, now_us());
}

}  // namespace sim_robot
