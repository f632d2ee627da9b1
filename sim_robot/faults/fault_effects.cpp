// Does faults to a robot, its world and its network, and ends them.
#include <stdexcept>

#include "sim_robot/faults/fault.hpp"
#include "sim_robot/robot/robot_life.hpp"

namespace sim_robot {
namespace {

// Kinds of a sensor come in the order of SensorFaultKind behind `none`.
SensorFaultKind sensor_kind(const Fault& fault, FaultKind first) {
  return static_cast<SensorFaultKind>(static_cast<int>(fault.kind) - static_cast<int>(first) + 1);
}

SensorFault sensor_fault(const Fault& fault, FaultKind first) {
  const SensorFaultKind kind = sensor_kind(fault, first);
  const bool has_magnitude = kind == SensorFaultKind::noisy || kind == SensorFaultKind::offset;
  return {kind, has_magnitude ? fault.magnitude : 0};
}

void pour(const Fault& fault, World& world) {
  GlucosePatch patch = fault.patch;
  patch.removed_at_s = world.glucose().time_s() + fault.for_s;
  world.pour(patch);
}

void drive_pump(const Fault& fault, World& world) {
  if (fault.kind == FaultKind::mean_flow) return world.set_mean_flow_m3_s(fault.mean_flow_m3_s);
  const bool is_constant = fault.pump == PumpSetting::constant;
  const double mean_flow_m3_s = fault.mean_flow_m_s * world.tube_area_m2();
  world.set_flow(is_constant ? PumpKind::constant : PumpKind::pulse_70_bpm, mean_flow_m3_s);
}

// The part of an impairment that a target names; the others are not touched.
void copy_part(FaultTarget target, const Impairment& from, Impairment& to) {
  switch (target) {
    case FaultTarget::delay:
      to.delay_s = from.delay_s;
      to.jitter_s = from.jitter_s;
      return;
    case FaultTarget::rate: to.bytes_per_s = from.bytes_per_s; return;
    case FaultTarget::loss:
      to.loss_probability = from.loss_probability;
      to.retransmit_s = from.retransmit_s;
      return;
    case FaultTarget::split: to.split_bytes = from.split_bytes; return;
    default: return;
  }
}

void impair(const Fault& fault, FaultyLink& link) {
  Impairment wanted;
  wanted.delay_s = fault.delay_s;
  wanted.jitter_s = fault.jitter_s;
  wanted.bytes_per_s = fault.bytes_per_s;
  wanted.loss_probability = fault.loss_probability;
  wanted.retransmit_s = fault.retransmit_s;
  wanted.split_bytes = fault.split_bytes;
  LinkImpairments next = link.impairments();
  const FaultTarget target = type_of(fault.kind).target;
  if (fault.direction != Direction::down) copy_part(target, wanted, next.up);
  if (fault.direction != Direction::up) copy_part(target, wanted, next.down);
  link.impair(next.up, next.down);
}

void restore(FaultTarget target, FaultyLink& link) {
  LinkImpairments next = link.impairments();
  copy_part(target, link.made_with().up, next.up);
  copy_part(target, link.made_with().down, next.down);
  link.impair(next.up, next.down);
}

void break_link(const Fault& fault, FaultyLink& link) {
  switch (fault.kind) {
    case FaultKind::link_outage: return link.outage(fault.for_s, fault.then_reset);
    case FaultKind::link_half_open: return link.half_open(fault.direction);
    case FaultKind::link_cut: return link.cut(fault.after_bytes);
    case FaultKind::link_reset: return link.reset();
    default: return impair(fault, link);
  }
}

void mend_link(const Fault& fault, FaultyLink& link) {
  const FaultTarget target = type_of(fault.kind).target;
  if (target != FaultTarget::link) return restore(target, link);
  if (fault.then_reset) link.reset();  // first, so that nothing that waits arrives
  link.resume();
}

bool is_of_link(FaultTarget target) {
  switch (target) {
    case FaultTarget::link:
    case FaultTarget::delay:
    case FaultTarget::rate:
    case FaultTarget::loss:
    case FaultTarget::split: return true;
    default: return false;
  }
}

void upset(const Fault& fault, RobotLife& life) {
  switch (fault.kind) {
    case FaultKind::reboot: return life.reboot({fault.cause, fault.off_for_s, fault.keeps_latch, fault.keeps_storage});
    case FaultKind::block: return life.block(fault.for_s);
    case FaultKind::clock_drift: return life.drift(fault.drift_ppm);
    case FaultKind::clock_jump: return life.jump_clock(fault.jump_s);
    default: return;
  }
}

}  // namespace

std::string why_not(FaultKind kind, bool has_network) {
  if (has_network || !is_of_link(type_of(kind).target)) return "";
  return std::string(type_of(kind).name) + ": not in this run, which has no network of its own to break";
}

void check(const Fault& fault, const FaultyRobot& robot) {
  check(fault, robot.life.robot().config().world);
  if (const std::string reason = why_not(fault.kind, robot.link != nullptr); !reason.empty())
    throw std::invalid_argument(reason);
}

void apply(const Fault& fault, const FaultyRobot& robot) {
  check(fault, robot);
  const FaultTarget target = type_of(fault.kind).target;
  if (is_of_link(target)) return break_link(fault, *robot.link);
  World& world = robot.life.robot().world();
  switch (target) {
    case FaultTarget::accelerometer:
      return world.set_fault(Sensor::accelerometer, sensor_fault(fault, FaultKind::accelerometer_stuck));
    case FaultTarget::electrode:
      return world.set_fault(Sensor::electrode, sensor_fault(fault, FaultKind::electrode_stuck));
    case FaultTarget::pump: return drive_pump(fault, world);
    case FaultTarget::glucose: return pour(fault, world);
    case FaultTarget::motor_supply: return world.cut_motor_supply(true);
    default: return upset(fault, robot.life);
  }
}

void end(const Fault& fault, const FaultyRobot& robot) {
  const FaultTarget target = type_of(fault.kind).target;
  if (is_of_link(target)) return mend_link(fault, *robot.link);
  const SimulatedRobotConfig& config = robot.life.robot().config();
  World& world = robot.life.robot().world();
  switch (target) {
    case FaultTarget::accelerometer: return world.set_fault(Sensor::accelerometer, {});
    case FaultTarget::electrode: return world.set_fault(Sensor::electrode, {});
    case FaultTarget::pump: {
      const PumpParameters& pump = config.world.vessel->pump;
      return world.set_flow(pump.kind, pump.mean_flow_m3_s);
    }
    case FaultTarget::robot: return robot.life.unblock();
    case FaultTarget::clock: return robot.life.drift(config.clock_drift_ppm);
    case FaultTarget::motor_supply: return world.cut_motor_supply(false);
    default: return;
  }
}

bool ends_by_itself(FaultKind kind) { return kind == FaultKind::link_outage || kind == FaultKind::block; }

}  // namespace sim_robot
