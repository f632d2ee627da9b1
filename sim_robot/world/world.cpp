// Steps the parts of the world in the order in which they act on each other.
#include "sim_robot/world/world.hpp"

#include <algorithm>

#include "base/invalid_argument.hpp"

namespace sim_robot {
namespace {

constexpr unsigned kImuCalibration = 3;                        // the best the BNO055 reports
constexpr std::uint64_t kElectrodeSeed = 0x9E3779B97F4A7C15U;  // apart from the accelerometer's

}  // namespace

void check(const WorldConfig& config) {
  check(config.plant);
  check(config.motor);
  check(config.battery);
  if (config.vessel) check(*config.vessel);
  check(config.glucose);
  if (config.imu) check(*config.imu);
  check(config.electrode);
}

World::World(const WorldConfig& config)
    : plant_(config.plant, kTickS),
      motor_(config.motor),
      battery_(config.battery),
      glucose_(config.glucose),
      electrode_(config.electrode, config.seed ^ kElectrodeSeed) {
  if (config.vessel) {
    vessel_.emplace(*config.vessel);
    velocity_m_s_ = flow_velocity_m_s_ = vessel_->velocity_m_s(0);
  }
  if (config.imu) imu_.emplace(*config.imu, config.seed);
}

void World::step(double duty) {
  const double velocity_before_m_s = velocity_m_s_;
  const double driven = motor_supply_is_cut_ ? 0 : motor_.driven(duty);
  battery_.step(driven);
  plant_.step(motor_.step(driven, battery_.supply_ratio()));
  position_m_ = plant_.position_m();
  velocity_m_s_ = plant_.velocity_m_s();
  acceleration_m_s2_ = plant_.acceleration_m_s2();
  if (vessel_) {
    carry();
    stop_at_walls(velocity_before_m_s);
  }
  glucose_.step();
  electrode_.step();
  if (imu_) imu_->accelerate(acceleration_m_s2_, (velocity_m_s_ - velocity_before_m_s) / kTickS);
}

void World::carry() {
  const double flow_before_m_s = flow_velocity_m_s_;
  vessel_->step();
  const double expected_m = position_m_ + carried_m_ + kTickS * flow_before_m_s;
  flow_velocity_m_s_ = vessel_->velocity_m_s(expected_m);
  carried_m_ += kTickS * (flow_before_m_s + flow_velocity_m_s_) / 2;
  position_m_ += carried_m_;  // (1)
  velocity_m_s_ += flow_velocity_m_s_;
  acceleration_m_s2_ += (flow_velocity_m_s_ - flow_before_m_s) / kTickS;
}

void World::stop_at_walls(double velocity_before_m_s) {
  const bool was_at_wall = is_at_wall_;
  const double within_m = std::clamp(position_m_, vessel_->first_m(), vessel_->last_m());
  is_at_wall_ = within_m != position_m_;
  if (is_at_wall_) {
    carried_m_ += within_m - position_m_;
    position_m_ = within_m;
    velocity_m_s_ = 0;
  }
  if (is_at_wall_ || was_at_wall) acceleration_m_s2_ = (velocity_m_s_ - velocity_before_m_s) / kTickS;
}

robot_fw::Inputs World::read(std::uint64_t robot_time_us) {
  robot_fw::Inputs inputs;
  inputs.robot_time_us = robot_time_us;
  if (imu_) {
    const ImuReading reading = imu_->read();
    inputs.acceleration_counts = reading.counts;
    inputs.acceleration_is_valid = reading.is_valid;
  } else {
    inputs.known_motion = {static_cast<float>(position_m_), static_cast<float>(velocity_m_s_),
                           static_cast<float>(acceleration_m_s2_)};
  }
  inputs.impedance_mv = static_cast<float>(electrode_.read(impedance_mv()));
  inputs.supply_mv = static_cast<float>(supply_mv());
  inputs.motor_supply_is_cut = motor_supply_is_cut_;
  inputs.imu_calibration = kImuCalibration;
  return inputs;
}

void World::set_fault(Sensor sensor, const SensorFault& fault) {
  check(fault);
  if (sensor == Sensor::electrode) return electrode_.set_fault(fault);
  if (!imu_) base::throw_invalid("the perfect sensor has no faults; give the world an imu");
  imu_->set_fault(fault);
}

void World::set_mean_flow_m3_s(double flow_m3_s) {
  if (!vessel_) base::throw_invalid("a mean flow of ", flow_m3_s, " m3/s needs a vessel");
  vessel_->set_mean_flow_m3_s(flow_m3_s);
}

void World::set_flow(PumpKind kind, double mean_flow_m3_s) {
  if (!vessel_) base::throw_invalid("a mean flow of ", mean_flow_m3_s, " m3/s needs a vessel");
  vessel_->set_flow(kind, mean_flow_m3_s);
}

}  // namespace sim_robot
