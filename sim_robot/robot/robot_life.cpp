// Resets the robot, keeps its memories and runs its clock.
#include "sim_robot/robot/robot_life.hpp"

#include <algorithm>
#include <cmath>

#include "sim_robot/world/microseconds.hpp"

namespace sim_robot {
namespace {

// SplitMix64: one to one, so that what is random stays so.
std::uint64_t boot_id_after(std::uint64_t boot_id) {
  std::uint64_t mixed = boot_id + 0x9E3779B97F4A7C15;
  mixed = (mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9;
  mixed = (mixed ^ (mixed >> 27)) * 0x94D049BB133111EB;
  mixed ^= mixed >> 31;
  return mixed == 0 ? 1 : mixed;
}

}  // namespace

std::size_t RobotLife::Storage::load(robot_fw::StorageKey key, std::uint8_t* bytes, std::size_t capacity) {
  const auto found = values_.find(key);
  if (found == values_.end() || found->second.size() > capacity) return 0;
  std::copy(found->second.begin(), found->second.end(), bytes);
  return found->second.size();
}

bool RobotLife::Storage::save(robot_fw::StorageKey key, protocol::Bytes bytes) {
  values_[key].assign(bytes.begin(), bytes.end());
  return true;
}

RobotLife::RobotLife(SimulatedRobotConfig config) : robot_(with_storage(std::move(config))) {
  drift(robot_.config().clock_drift_ppm);
}

SimulatedRobotConfig RobotLife::with_storage(SimulatedRobotConfig config) {
  if (config.storage == nullptr) config.storage = &storage_;
  return config;
}

void RobotLife::advance_to(std::uint64_t true_us) {
  if (!is_on()) {
    const std::uint64_t off_until_us = std::min(true_us, on_at_us_);
    const std::uint64_t ticks = (off_until_us - coasted_to_us_) / SimulatedRobot::kPeriodUs;
    robot_.coast(ticks);
    coasted_to_us_ += ticks * SimulatedRobot::kPeriodUs;
  }
  true_us_ = true_us;
  if (!is_on()) return;
  if (is_blocked()) {
    robot_.idle_to(robot_clock_us());
  } else {
    robot_.advance_to(robot_clock_us());
  }
}

// SAFETY: the old core is gone at once, and with it the duty; the new one starts with duty 0.
void RobotLife::reboot(const Reboot& reboot) {
  SimulatedRobotConfig next = robot_.config();
  next.boot_id = boot_id_after(robot_.config().boot_id);
  next.reset_cause = reboot.cause;
  next.restored_emergency_id = reboot.keeps_latch ? core().emergency_id() : 0;
  next.restored_emergency_cause = reboot.keeps_latch ? core().emergency_cause() : rheonaut_EMERGENCY_CAUSE_NONE;
  if (!reboot.keeps_storage) storage_.erase();
  archive_boot();
  robot_.reset(next);
  ++boots_;
  coasted_to_us_ = true_us_;
  on_at_us_ = true_base_us_ = true_us_ + microseconds(reboot.off_for_s);
  clock_base_us_ = 0;
  free_at_us_ = 0;
}

void RobotLife::archive_boot() {
  const robot_fw::TelemetryRing& ring = core().samples();
  lost_at_reboot_ = ring.fill();
  earlier_.samples_made += ring.next_seq();
  earlier_.samples_lost += ring.lost() + ring.fill();
  earlier_.commands += core().commands_received();
  earlier_.missed_ticks += robot_.missed_ticks();
}

void RobotLife::block(double for_s) { free_at_us_ = std::max(free_at_us_, end_us(true_us_, for_s)); }

void RobotLife::unblock() { free_at_us_ = 0; }

void RobotLife::drift(double ppm) {
  keep_clock();
  clock_rate_ = 1 + 1e-6 * ppm;
}

void RobotLife::jump_clock(double by_s) {
  keep_clock();
  const std::uint64_t before_us = robot_.robot_time_us();
  robot_.jump_clock(std::llround(1e6 * by_s));
  clock_base_us_ += static_cast<double>(robot_.robot_time_us()) - static_cast<double>(before_us);
}

std::uint64_t RobotLife::next_tick_us() const {
  const double ahead_us = static_cast<double>(robot_.robot_time_us()) - clock_base_us_;
  const auto until_due_us = static_cast<std::uint64_t>(std::ceil(std::max(0.0, ahead_us) / clock_rate_));
  return std::max({true_base_us_ + until_due_us, on_at_us_, free_at_us_});
}

std::uint64_t RobotLife::robot_clock_us() const {
  return static_cast<std::uint64_t>(std::floor(std::max(0.0, clock_us())));
}

void RobotLife::keep_clock() {
  clock_base_us_ = clock_us();
  true_base_us_ = std::max(true_base_us_, true_us_);  // while it is off, the clock stands
}

double RobotLife::clock_us() const {
  const double since_us = static_cast<double>(true_us_) - static_cast<double>(true_base_us_);
  return clock_base_us_ + clock_rate_ * std::max(0.0, since_us);
}

}  // namespace sim_robot
