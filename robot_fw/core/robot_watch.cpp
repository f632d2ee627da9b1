// What the robot watches in each tick: sensors, link, limits, impedance, arrival.
#include <algorithm>
#include <cmath>

#include "robot_fw/core/robot.hpp"

namespace robot_fw {
namespace {

constexpr float kInPlaceM = 0.005F;  // while delivering: farther off, a reading says nothing about the place

protocol::EmergencyCause cause_of(SensorFault fault) {
  switch (fault) {
    case SensorFault::none: break;
    case SensorFault::missing: return rheonaut_EMERGENCY_CAUSE_SENSOR_MISSING;
    case SensorFault::stuck: return rheonaut_EMERGENCY_CAUSE_SENSOR_STUCK;
    case SensorFault::out_of_range: return rheonaut_EMERGENCY_CAUSE_SENSOR_OUT_OF_RANGE;
  }
  return rheonaut_EMERGENCY_CAUSE_INTERNAL_ERROR;
}

}  // namespace

// A fault is an event, and in auto an emergency. In manual the operator may go on by eye.
void Robot::watch_sensors() {
  if (motion_sense_.fault_changed()) {
    on_sensor_news(motion_sense_.fault(), rheonaut_EVENT_CAUSE_SENSOR,
                   kMS2PerCount * static_cast<float>(inputs_.acceleration_counts));
  }
  electrode_.step(inputs_.impedance_mv, true);
  if (electrode_fault() != reported_electrode_fault_) {
    reported_electrode_fault_ = electrode_fault();
    on_sensor_news(reported_electrode_fault_, rheonaut_EVENT_CAUSE_IMPEDANCE, inputs_.impedance_mv);
  }
  if (motion_sense_.mismatch_changed()) {
    note(motion_sense_.model_mismatch() ? rheonaut_EVENT_KIND_MODEL_MISMATCH : rheonaut_EVENT_KIND_MODEL_MISMATCH_ENDED,
         rheonaut_EVENT_CAUSE_SENSOR, std::sqrt(motion_sense_.surprise()));
  }
}

void Robot::on_sensor_news(SensorFault fault, protocol::EventCause which, float reading) {
  const bool faulty = fault != SensorFault::none;
  note(faulty ? rheonaut_EVENT_KIND_SENSOR_FAULT : rheonaut_EVENT_KIND_SENSOR_RECOVERED, which, reading);
  // SAFETY: nothing steers by a sensor that cannot be believed.
  if (faulty && pilot_.is_auto()) emergency(cause_of(fault), which, 0);
}

SensorFault Robot::electrode_fault() const {
  return settings_.parameters()[ParameterId::impedance_monitor] == 0 ? SensorFault::none : electrode_.fault();
}

bool Robot::sensor_fault_stands() const {
  return motion_sense_.fault() != SensorFault::none || electrode_fault() != SensorFault::none;
}

// Somebody has cut the motor's supply. What was ordered would otherwise go on the moment that it is back.
void Robot::watch_supply() {
  // SAFETY: the motor comes back when a person clears this, never with its supply alone.
  if (!inputs_.motor_supply_is_cut || safety_.latched()) return;
  emergency(rheonaut_EMERGENCY_CAUSE_MOTOR_SUPPLY_CUT, rheonaut_EVENT_CAUSE_MOTOR_SUPPLY, 0);
}

void Robot::watch_link() {
  if (!channel_.goes_lost(now_us_)) return;
  note(rheonaut_EVENT_KIND_LINK_LOST, rheonaut_EVENT_CAUSE_LINK_LOSS, 0);
  drop_timed_commands(kTimedExpired);
  const LinkLossAction action = settings_.parameters().link_loss_action();
  if (!pilot_.is_auto() || action == LinkLossAction::stop) {
    const bool was_auto = pilot_.is_auto();
    stop_motion(rheonaut_EVENT_CAUSE_LINK_LOSS);  // SAFETY: nobody is there to stop it
    if (was_auto) note(rheonaut_EVENT_KIND_MODE_CHANGED, rheonaut_EVENT_CAUSE_LINK_LOSS, 0);
    return;
  }
  pilot_.outlive_link(settings_.parameters()[ParameterId::link_loss_limit_s], now_us_);
  if (action == LinkLossAction::go_on) return;
  if (pilot_.delivering()) end_delivery(rheonaut_EVENT_CAUSE_LINK_LOSS, 0);
  const PositionLimits limits = position_limits();
  const float here_m =
      std::clamp(motion_sense_.motion().position_m, limits.min_m, limits.max_m) + pilot_.disturbance_m();
  pilot_.set_setpoint(here_m);
  profile_.restart();
  note(rheonaut_EVENT_KIND_SETPOINT_CHANGED, rheonaut_EVENT_CAUSE_LINK_LOSS, here_m);
}

// Where the robot is, without the disturbance, and how long the motor has been at power in the ticks before this one.
void Robot::watch_limits(const Motion& measured, float dt_s) {
  if (!inputs_are_sound_) return;
  const PositionLimits limits = position_limits();
  const float position_m = measured.position_m - pilot_.disturbance_m();
  if (safety_.leaves_limits(position_m, limits)) {
    const float limit_m = position_m > limits.max_m ? limits.max_m : limits.min_m;
    note(rheonaut_EVENT_KIND_LIMIT_HIT, rheonaut_EVENT_CAUSE_LIMIT, limit_m);
    // SAFETY: a robot that leaves its stretch of the vessel stops; a latch of another cause stays what it is.
    if (!safety_.latched()) emergency(rheonaut_EMERGENCY_CAUSE_POSITION_LIMIT, rheonaut_EVENT_CAUSE_LIMIT, 0);
  }
  safety_.watch_certainty(position_m, 2 * motion_sense_.position_sd_m(), limits);
  const PowerLimit power{settings_.parameters()[ParameterId::power_limit_duty],
                         settings_.parameters()[ParameterId::power_limit_s]};
  if (safety_.too_long_at_power(duty_, dt_s, power)) {
    note(rheonaut_EVENT_KIND_LIMIT_HIT, rheonaut_EVENT_CAUSE_LIMIT, power.time_s);
    emergency(rheonaut_EMERGENCY_CAUSE_TIME_AT_POWER, rheonaut_EVENT_CAUSE_LIMIT, 0);  // SAFETY: a motor gets hot
  }
}

// SAFETY: motion towards a limit that may have been reached already ends: manual at duty 0, once, so that somebody
// looks. The way out is to bring the robot to a known place and zero_position, or to turn round.
void Robot::watch_certainty(float wanted_duty) {
  if (safety_.latched() || safety_.outward(wanted_duty) || !safety_.uncertain(wanted_duty)) return;
  const bool was_auto = pilot_.is_auto();
  stop_motion(rheonaut_EVENT_CAUSE_LIMIT);
  note(rheonaut_EVENT_KIND_POSITION_UNCERTAIN, rheonaut_EVENT_CAUSE_LIMIT, 2 * motion_sense_.position_sd_m());
  if (was_auto) note(rheonaut_EVENT_KIND_MODE_CHANGED, rheonaut_EVENT_CAUSE_LIMIT, 0);
  drop_timed_commands(rejected(rheonaut_REJECT_REASON_UNCERTAIN));
}

// Glucose on the way: the robot holds where it has found it until it has mixed.
void Robot::watch_impedance(const Motion& measured) {
  if (settings_.parameters()[ParameterId::impedance_monitor] == 0 || !inputs_are_sound_) return;
  const float impedance_mv = inputs_.impedance_mv;
  const bool can_return =
      settings_.controllers().in_force().duty_min < 0;  // a motor without reverse stays where it comes to rest
  const bool in_place =
      !pilot_.delivering() || !can_return || std::fabs(measured.position_m - *pilot_.target_m()) <= kInPlaceM;
  const bool usable = electrode_fault() == SensorFault::none && electrode_.in_range(impedance_mv);
  const bool detected = impedance_.step(impedance_mv, usable, in_place, settings_.parameters().impedance());
  if (pilot_.delivering() && impedance_.mixed()) end_delivery(rheonaut_EVENT_CAUSE_IMPEDANCE, 0);
  if (!detected || pilot_.delivering()) return;  // in a delivery it is the same glucose
  note(rheonaut_EVENT_KIND_DETECTION, rheonaut_EVENT_CAUSE_IMPEDANCE, impedance_mv);
  if (!pilot_.is_auto()) return;
  pilot_.start_delivery(measured.position_m, settings_.parameters()[ParameterId::delivery_limit_s], now_us_);
  profile_.restart();
  note(rheonaut_EVENT_KIND_DELIVERY_STARTED, rheonaut_EVENT_CAUSE_IMPEDANCE, impedance_mv);
}

void Robot::end_delivery(protocol::EventCause cause, std::uint64_t command_id) {
  const float lasted_s = pilot_.end_delivery(now_us_);
  profile_.restart();
  note(rheonaut_EVENT_KIND_DELIVERY_ENDED, cause, lasted_s, command_id);
}

void Robot::watch_arrival(const Motion& measured) {
  if (pilot_.arrival_changed(measured.position_m)) {
    note(rheonaut_EVENT_KIND_SUB_STATE_CHANGED, rheonaut_EVENT_CAUSE_NONE, 0);
  }
}

}  // namespace robot_fw
