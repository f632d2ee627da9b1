// Readings from the world into the core, duty from the core into the world.
#include "sim_robot/robot/simulated_robot.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <memory>
#include <random>
#include <stdexcept>
#include <utility>

#include "base/version.hpp"

namespace sim_robot {
namespace {

constexpr int kRssiDbm = -50;
constexpr double kMostDriftPpm = 100'000;
constexpr std::uint64_t kPeriodsToMotorOff = 5;  // robot_fw::kMotorOffS, counted from the last tick
const std::string kFirmware = std::string{"sim-"} + base::version();

robot_fw::RobotConfig core_config(const SimulatedRobotConfig& config) {
  robot_fw::RobotConfig core;
  core.robot_id = config.robot_id.c_str();
  core.token = config.token.c_str();
  core.firmware_version = kFirmware.c_str();
  core.boot_id = config.boot_id;
  core.reset_cause = config.reset_cause;
  core.duty_min = config.duty.min;
  core.duty_max = config.duty.max;
  core.samples_per_frame = config.samples_per_frame;
  core.sample_period_us = SimulatedRobot::kPeriodUs;
  core.storage = config.storage;
  core.restored_emergency_id = config.restored_emergency_id;
  core.restored_emergency_cause = config.restored_emergency_cause;
  return core;
}

}  // namespace

std::uint64_t random_boot_id() {
  std::random_device random;
  for (;;) {
    const std::uint64_t id = (std::uint64_t{random()} << 32) | random();
    if (id != 0) return id;
  }
}

std::uint64_t parse_boot_id(const std::string& text) {
  const std::size_t start = text.starts_with("0x") ? 2 : 0;
  std::uint64_t id = 0;
  const auto [end, error] = std::from_chars(text.data() + start, text.data() + text.size(), id, 16);
  if (id == 0 || error != std::errc{} || end != text.data() + text.size()) {
    throw std::invalid_argument("boot id '" + text + "' is not a hexadecimal number of up to 16 digits other than 0");
  }
  return id;
}

void check(const SimulatedRobotConfig& config) {
  const std::string& id = config.robot_id;
  if (id.empty() || id.size() > 31 || id.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_-") != id.npos) {
    throw std::invalid_argument("robot id '" + id + "' is not 1 to 31 characters of [a-z0-9_-]");
  }
  if (config.token.size() > 71) {
    throw std::invalid_argument("token of " + std::to_string(config.token.size()) + " characters; at most 71 are sent");
  }
  if (config.boot_id == 0) throw std::invalid_argument("boot id 0 means none; give another");
  const auto [min, max] = config.duty;
  if (!(min >= -1 && min <= 0 && max > 0 && max <= 1)) {
    throw std::invalid_argument("duty range [" + std::to_string(min) + ", " + std::to_string(max) +
                                "] is not within [-1, 0] and (0, 1]");
  }
  if (!(std::abs(config.clock_drift_ppm) <= kMostDriftPpm)) {
    throw std::invalid_argument("clock drift of " + std::to_string(config.clock_drift_ppm) +
                                " ppm is not within -100000 and 100000");
  }
  if (config.samples_per_frame < 1 || config.samples_per_frame > protocol::kMaxSamplesPerFrame) {
    throw std::invalid_argument(std::to_string(config.samples_per_frame) + " samples a frame is not within 1 and 25");
  }
  check(config.world);
}

SimulatedRobot::SimulatedRobot(SimulatedRobotConfig config)
    : config_(std::move(config)), core_(core_config(config_)), world_(config_.world) {}

void SimulatedRobot::step() {
  robot_fw::Inputs inputs = world_.read(robot_time_us_);
  inputs.rssi_dbm = kRssiDbm;
  inputs.missed_ticks = missed_ticks_;
  const robot_fw::Outputs outputs = core_.step(inputs, static_cast<float>(kPeriodS));
  skipped_ = 0;
  motor_duty_ = static_cast<double>(outputs.duty);
  world_.step(motor_duty_);
  robot_time_us_ += kPeriodUs;
}

// The ring is left out: a tick writes one place of it.
void SimulatedRobot::prefetch() const {
  const auto fetch = [](const void* begin, const void* end) {
    constexpr std::ptrdiff_t kLine = 64;
    for (const auto* at = static_cast<const char*>(begin); at < end; at += kLine) __builtin_prefetch(at, 1);
  };
  fetch(&core_, &core_.samples());
  fetch(&core_.samples() + 1, &world_ + 1);
  world_.prefetch();
}

void SimulatedRobot::advance_to(std::uint64_t now_us) {
  if (now_us > robot_time_us_ + kMaxLatenessUs) skip((now_us - robot_time_us_) / kPeriodUs);
  while (robot_time_us_ <= now_us) step();
}

void SimulatedRobot::idle_to(std::uint64_t now_us) {
  const bool skips = skipped_ > 0 || now_us > robot_time_us_ + kMaxLatenessUs;
  if (skips && now_us > robot_time_us_) skip((now_us - robot_time_us_) / kPeriodUs);
}

void SimulatedRobot::skip(std::uint64_t ticks) {
  for (std::uint64_t i = 0; i < ticks; ++i) {
    if (++skipped_ >= kPeriodsToMotorOff) motor_duty_ = 0;  // the last tick's own period was the first
    world_.step(motor_duty_);
  }
  robot_time_us_ += ticks * kPeriodUs;
  missed_ticks_ += static_cast<std::uint32_t>(ticks);
}

void SimulatedRobot::reset(const SimulatedRobotConfig& config) {
  config_ = config;
  std::destroy_at(&core_);
  std::construct_at(&core_, core_config(config_));
  robot_time_us_ = 0;
  missed_ticks_ = 0;
  skipped_ = 0;
  motor_duty_ = 0;
}

void SimulatedRobot::coast(std::uint64_t ticks) {
  for (std::uint64_t i = 0; i < ticks; ++i) world_.step(0);
}

void SimulatedRobot::jump_clock(std::int64_t by_us) {
  robot_time_us_ =
      static_cast<std::uint64_t>(std::max<std::int64_t>(0, static_cast<std::int64_t>(robot_time_us_) + by_us));
}

}  // namespace sim_robot
