// Sensors from the plant into the core, duty from the core into the plant.
#include "sim_robot/simulated_robot.hpp"

#include <algorithm>
#include <charconv>
#include <memory>
#include <random>
#include <stdexcept>
#include <utility>

namespace sim_robot {
namespace {

constexpr float kImpedanceMv = 175;  // no glucose anywhere
constexpr float kSupplyMv = 3000;    // a fresh CR123A
constexpr int kRssiDbm = -50;
constexpr std::uint64_t kTicksToMotorOff = 5;
constexpr unsigned kImuCalibration = 3;  // the best the BNO055 reports

robot_fw::RobotConfig core_config(const SimulatedRobotConfig& config) {
  robot_fw::RobotConfig core;
  core.robot_id = config.robot_id.c_str();
  core.token = config.token.c_str();
  core.firmware_version = "sim-0.1.0";
  core.boot_id = config.boot_id;
  core.reset_cause = config.reset_cause;
  core.duty_min = config.duty.min;
  core.duty_max = config.duty.max;
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
}

SimulatedRobot::SimulatedRobot(SimulatedRobotConfig config)
    : config_(std::move(config)), core_(core_config(config_)), plant_(config_.model, kPeriodS) {
  if (config_.imu) imu_.emplace(*config_.imu, config_.seed);
}

void SimulatedRobot::step() {
  robot_fw::Inputs inputs;
  inputs.robot_time_us = robot_time_us_;
  if (imu_) {
    const ImuReading reading = imu_->read();
    inputs.acceleration_counts = reading.counts;
    inputs.acceleration_is_valid = reading.is_valid;
  } else {
    inputs.known_motion = {static_cast<float>(plant_.position_m()), static_cast<float>(plant_.velocity_m_s()),
                           static_cast<float>(plant_.acceleration_m_s2())};
  }
  const double time_s = 1e-6 * static_cast<double>(robot_time_us_);
  inputs.impedance_mv = config_.impedance_mv ? config_.impedance_mv(plant_.position_m(), time_s) : kImpedanceMv;
  inputs.supply_mv = kSupplyMv;
  inputs.rssi_dbm = kRssiDbm;
  inputs.imu_calibration = kImuCalibration;
  inputs.missed_ticks = missed_ticks_;
  const robot_fw::Outputs outputs = core_.step(inputs, static_cast<float>(kPeriodS));
  move(outputs.duty);
  robot_time_us_ += kPeriodUs;
}

void SimulatedRobot::move(float duty) {
  plant_.step(static_cast<double>(duty));
  if (imu_) imu_->accelerate(plant_.acceleration_m_s2(), kPeriodS);
}

void SimulatedRobot::advance_to(std::uint64_t now_us) {
  if (now_us > robot_time_us_ + kMaxLatenessUs) skip((now_us - robot_time_us_) / kPeriodUs);
  while (robot_time_us_ <= now_us) step();
}

void SimulatedRobot::skip(std::uint64_t ticks) {
  for (std::uint64_t i = 0; i < ticks; ++i) move(i < kTicksToMotorOff ? core_.duty() : 0);
  robot_time_us_ += ticks * kPeriodUs;
  missed_ticks_ += static_cast<std::uint32_t>(ticks);
}

void SimulatedRobot::reset(const SimulatedRobotConfig& config) {
  config_ = config;
  std::destroy_at(&core_);
  std::construct_at(&core_, core_config(config_));
  robot_time_us_ = 0;
  missed_ticks_ = 0;
}

void SimulatedRobot::coast(std::uint64_t ticks) {
  for (std::uint64_t i = 0; i < ticks; ++i) move(0);
}

void SimulatedRobot::jump_clock(std::int64_t by_us) {
  robot_time_us_ =
      static_cast<std::uint64_t>(std::max<std::int64_t>(0, static_cast<std::int64_t>(robot_time_us_) + by_us));
}

}  // namespace sim_robot
