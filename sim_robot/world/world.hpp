// Everything around the robot's core: the body in its fluid, motor, battery, vessel, glucose and sensors.
//
//   position = plant's + ∫ flow velocity at its place dt, velocity = plant's + flow's                (1)
// The plant moves relative to the fluid. A body that is as heavy as the fluid it displaces is carried by the flow
// exactly, so the accelerometer feels the rate of the sum, and nothing of a steady flow. At a wall the robot stops.
// Shapes:   one step() for each tick, then one read(); a read() before the first step is at rest.
// Cost:     no heap and no transcendental functions in a tick but in the sensors' noise.
// Errors:   throws std::invalid_argument quoting the bad value.
#pragma once

#include <cstdint>
#include <optional>

#include "robot_fw/core/hardware_io.hpp"
#include "sim_robot/world/battery.hpp"
#include "sim_robot/world/electrode.hpp"
#include "sim_robot/world/glucose.hpp"
#include "sim_robot/world/imu.hpp"
#include "sim_robot/world/motor.hpp"
#include "sim_robot/world/plant.hpp"
#include "sim_robot/world/tick.hpp"
#include "sim_robot/world/vessel.hpp"

namespace sim_robot {

// As it stands: the fluid of (29), at rest and without end, no glucose, a perfect sensor and a battery that never sags.
struct WorldConfig {
  PlantParameters plant;
  MotorParameters motor;
  BatteryParameters battery;
  std::optional<VesselParameters> vessel;  // empty: fluid at rest without end
  GlucoseParameters glucose;
  std::optional<ImuParameters> imu;  // empty: a perfect sensor, which gives the core the true position
  ElectrodeParameters electrode;
  std::uint64_t seed = 1;  // of the sensors' noise
};

void check(const WorldConfig& config);

class World {
 public:
  explicit World(const WorldConfig& config);

  // One tick under a duty of the robot.
  void step(double duty);
  // What the sensors say now.
  robot_fw::Inputs read(std::uint64_t robot_time_us);

  // From the next reading on, until another is set.
  void set_fault(Sensor sensor, const SensorFault& fault);
  // From now on, over the pump's ramp; there must be a vessel.
  void set_mean_flow_m3_s(double flow_m3_s);
  void set_flow(PumpKind kind, double mean_flow_m3_s);  // the same with another kind
  void pour(const GlucosePatch& patch) { glucose_.pour(patch); }
  // The switch in the motor's supply: the motor gets nothing while it is open, and the robot senses it.
  void cut_motor_supply(bool is_cut) { motor_supply_is_cut_ = is_cut; }

  // The truth. Positions from where the robot booted.
  void prefetch() const { plant_.prefetch(); }  // see SimulatedRobot

  double position_m() const { return position_m_; }
  double velocity_m_s() const { return velocity_m_s_; }
  double acceleration_m_s2() const { return acceleration_m_s2_; }
  double flow_velocity_m_s() const { return flow_velocity_m_s_; }  // at the robot
  double flow_m3_s() const { return vessel_ ? vessel_->pump().flow_m3_s() : 0; }
  double impedance_mv() const { return glucose_.impedance_mv(position_m_); }  // at the robot
  double accelerometer_bias_m_s2() const { return imu_ ? imu_->bias_m_s2() : 0; }
  double supply_mv() const { return battery_.supply_mv(); }
  double tube_area_m2() const { return vessel_ ? vessel_->tube_area_m2(position_m_) : 0; }  // at the robot
  const std::optional<Vessel>& vessel() const { return vessel_; }
  const Glucose& glucose() const { return glucose_; }

 private:
  void carry();
  void stop_at_walls(double velocity_before_m_s);

  Plant plant_;
  Motor motor_;
  Battery battery_;
  std::optional<Vessel> vessel_;
  Glucose glucose_;
  std::optional<Imu> imu_;
  Electrode electrode_;
  double carried_m_ = 0;  // ∫ of (1)
  double flow_velocity_m_s_ = 0;
  double position_m_ = 0, velocity_m_s_ = 0, acceleration_m_s2_ = 0;
  bool is_at_wall_ = false;
  bool motor_supply_is_cut_ = false;
};

}  // namespace sim_robot
