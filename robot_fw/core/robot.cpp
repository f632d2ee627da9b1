// The tick.
#include "robot_fw/core/robot.hpp"

#include <algorithm>
#include <cmath>

#include "robot_fw/core/saturate.hpp"

namespace robot_fw {
namespace {

// The DS550's range; its readings may well be equal.
constexpr SensorRules kElectrodeRules{20, 1000, 1, 0, 5};
constexpr float kCoastingSdM = 0.025F;  // of the way that a robot reset at full speed still coasts, docs/robot.md
constexpr std::uint64_t kTimeStepPauseUs = 1'000'000;  // between two events, which are few in the ring
constexpr std::uint64_t kMaxTickLatenessUs = 100'000;  // against frames that came in before the tick

bool finite(const Motion& motion) {
  return std::isfinite(motion.position_m) && std::isfinite(motion.velocity_m_s) &&
         std::isfinite(motion.acceleration_m_s2);
}

}  // namespace

Robot::Robot(const RobotConfig& config)
    : config_(config),
      safety_({config.duty_min, config.duty_max}, config.boot_id),
      electrode_(kElectrodeRules),
      settings_({config.duty_min, config.duty_max}, config.sample_period_us),
      motion_sense_(settings_.parameters().estimator(),
                    config.reset_cause == rheonaut_RESET_CAUSE_POWER_ON ? 0.0F : kCoastingSdM),
      filter_(config.boot_id),
      channel_(config.samples_per_frame) {
  note(rheonaut_EVENT_KIND_BOOT, rheonaut_EVENT_CAUSE_RESET, 0);
  load_settings();
  const bool suspicious_reset =
      config.reset_cause == rheonaut_RESET_CAUSE_WATCHDOG || config.reset_cause == rheonaut_RESET_CAUSE_BROWN_OUT;
  if (config.restored_emergency_id != 0) {
    safety_.restore(config.restored_emergency_id, config.restored_emergency_cause);  // SAFETY: a reset clears nothing
    if (safety_.has_sensor_cause()) {
      motion_sense_.distrust();  // SAFETY: nor does it mend a sensor
      electrode_.distrust();
      reported_electrode_fault_ = electrode_fault();
    }
    note(rheonaut_EVENT_KIND_EMERGENCY, rheonaut_EVENT_CAUSE_RESET, 0);
  } else if (suspicious_reset) {
    emergency(rheonaut_EMERGENCY_CAUSE_RESET, rheonaut_EVENT_CAUSE_RESET, 0);  // SAFETY: comes up latched
  }
}

void Robot::load_settings() {
  if (config_.storage == nullptr) return;
  const auto faults = settings_.load(*config_.storage);
  if (faults.parameters) note(rheonaut_EVENT_KIND_PARAMETER_CHANGED, rheonaut_EVENT_CAUSE_RESET, 0);  // to the defaults
  if (faults.controller) note_controller(rheonaut_EVENT_CAUSE_RESET);  // the built-in one
  motion_sense_.set_parameters(settings_.parameters().estimator());
}

Outputs Robot::step(const Inputs& inputs, float dt_s) {
  inputs_are_sound_ = sound(inputs, dt_s);
  const float missed_s = watch_clock(inputs.robot_time_us, dt_s);
  inputs_ = inputs;
  worst_tick_us_ = std::max(worst_tick_us_, inputs.tick_us);

  motion_sense_.step(inputs, duty_, dt_s, missed_s);
  watch_sensors();
  watch_supply();
  watch_link();
  run_due_commands();
  let_orders_run_out();

  const Motion measured = seen_motion();
  watch_limits(measured, dt_s + std::min(missed_s, kMotorOffS));
  watch_impedance(measured);
  watch_arrival(measured);
  const ControllerDuty wanted = wanted_duty(measured, dt_s);
  if (!inputs_are_sound_ || !std::isfinite(wanted.asked)) {
    // SAFETY: a value that is not a number, or a clock that goes back, stops the robot; once, not in every tick.
    if (!safety_.latched()) emergency(rheonaut_EMERGENCY_CAUSE_INTERNAL_ERROR, rheonaut_EVENT_CAUSE_INTERNAL, 0);
  }
  watch_certainty(wanted.limited);
  saturated_ = !safety_.latched() && safety_.permit(wanted.limited) != wanted.asked;
  duty_ = safety_.permit(slewed(wanted.limited, dt_s));  // SAFETY: nothing after this line touches the duty
  announce_controller();
  record_sample(seen_motion(), dt_s);  // an emergency has ended the disturbance
  save_settings();
  return {duty_};
}

// SAFETY: while a clock that went back catches up, time stands still here: no lease and no link would run out.
bool Robot::sound(const Inputs& inputs, float dt_s) const {
  return inputs.robot_time_us >= inputs_.robot_time_us && inputs.robot_time_us + kMaxTickLatenessUs >= now_us_ &&
         finite(inputs.known_motion.value_or(Motion{})) && std::isfinite(inputs.impedance_mv) &&
         std::isfinite(inputs.supply_mv) && std::isfinite(dt_s) && dt_s > 0;
}

Motion Robot::seen_motion() const {
  Motion motion = motion_sense_.motion();
  motion.position_m += pilot_.disturbance_m();
  return motion;
}

// Takes over the time of this tick; a missed tick is an event. Says how much time was missed.
float Robot::watch_clock(std::uint64_t robot_time_us, float dt_s) {
  now_us_ = std::max(now_us_, robot_time_us);  // frames may have come in after this tick was due
  const auto elapsed_us = static_cast<std::int64_t>(robot_time_us - inputs_.robot_time_us);  // negative: it went back
  const float stepped_s = static_cast<float>(elapsed_us) * 1e-6F - dt_s;
  const bool stepped = channel_.samples().next_seq() > 0 && stepped_s > dt_s / 2;
  if (!stepped) return 0;
  unreported_step_s_ += stepped_s;
  if (time_step_reported_us_ == 0 || now_us_ - time_step_reported_us_ >= kTimeStepPauseUs) {
    note(rheonaut_EVENT_KIND_TIME_STEP, rheonaut_EVENT_CAUSE_TIME, unreported_step_s_);
    time_step_reported_us_ = now_us_;
    unreported_step_s_ = 0;
  }
  return stepped_s;
}

void Robot::run_due_commands() {
  // SAFETY: nothing acts for somebody who is no longer there; also when a running duty was not renewed.
  if (timed_.lease_lapsed(now_us_) || pilot_.lease_lapses(now_us_)) drop_timed_commands(kTimedExpired);
  while (const auto command = timed_.take_due(now_us_)) run_timed_command(*command);
}

void Robot::let_orders_run_out() {
  const float duty_before = pilot_.manual_duty();
  switch (pilot_.tick(now_us_)) {
    case Pilot::Lapse::none: break;
    case Pilot::Lapse::lease: note(rheonaut_EVENT_KIND_LEASE_LAPSED, rheonaut_EVENT_CAUSE_TIME, duty_before); break;
    case Pilot::Lapse::schedule: note(rheonaut_EVENT_KIND_DUTY_SCHEDULE_ENDED, rheonaut_EVENT_CAUSE_TIME, 0); break;
    case Pilot::Lapse::delivery_limit: end_delivery(rheonaut_EVENT_CAUSE_LIMIT, 0); break;
    case Pilot::Lapse::link_loss:
      stop_motion(rheonaut_EVENT_CAUSE_LINK_LOSS);  // SAFETY: without a station only for a while
      note(rheonaut_EVENT_KIND_MODE_CHANGED, rheonaut_EVENT_CAUSE_LINK_LOSS, 0);
      break;
    case Pilot::Lapse::auto_limit:
      stop_motion(rheonaut_EVENT_CAUSE_TIME);  // SAFETY: auto ends by itself
      note(rheonaut_EVENT_KIND_AUTO_LIMIT, rheonaut_EVENT_CAUSE_TIME, pilot_.auto_limit_s());
      note(rheonaut_EVENT_KIND_MODE_CHANGED, rheonaut_EVENT_CAUSE_TIME, 0);
      drop_timed_commands(rejected(rheonaut_REJECT_REASON_WRONG_MODE));
      break;
  }
}

ControllerDuty Robot::wanted_duty(const Motion& measured, float dt_s) {
  const auto target_m = pilot_.target_m();
  if (!target_m) return {pilot_.manual_duty(), pilot_.manual_duty()};
  const ProfileLimits limits{settings_.parameters()[ParameterId::profile_velocity_m_s],
                             settings_.parameters()[ParameterId::profile_acceleration_m_s2]};
  reference_m_ = profile_.step(*target_m, measured.position_m, limits, dt_s);
  return settings_.controllers().step(reference_m_ - measured.position_m, measured.position_m);
}

// The duty as near to the one wanted as the slew allows. In manual 0 is 0 at once: what ends, ends.
float Robot::slewed(float duty, float dt_s) const {
  const float slew_per_s = settings_.parameters()[ParameterId::duty_slew_per_s];
  if (slew_per_s <= 0 || (!pilot_.is_auto() && duty == 0)) return duty;
  return std::clamp(duty, duty_ - slew_per_s * dt_s, duty_ + slew_per_s * dt_s);
}

void Robot::record_sample(const Motion& measured, float dt_s) {
  Sample sample;
  sample.position_m = measured.position_m;
  sample.velocity_m_s = measured.velocity_m_s;
  sample.acceleration_m_s2 = measured.acceleration_m_s2;
  sample.duty = duty_;
  sample.impedance_mv = inputs_.impedance_mv;
  sample.reference_m = pilot_.is_auto() ? reference_m_ : 0;
  const bool usable_period = dt_s > 0 && dt_s < 1;
  const std::uint32_t period_us =
      usable_period ? saturated<std::uint32_t>(dt_s * 1e6F + 0.5F) : config_.sample_period_us;
  channel_.push(sample, batch_values(), saturated_, now_us_, period_us);
}

BatchValues Robot::batch_values() const {
  BatchValues values;
  values.emergency_id = safety_.emergency_id();
  values.emergency_cause = static_cast<std::uint8_t>(safety_.cause());
  values.mode = static_cast<std::uint8_t>(mode());
  values.sub_state = static_cast<std::uint8_t>(pilot_.sub_state());
  values.has_setpoint = pilot_.setpoint_m().has_value();
  values.setpoint_m = pilot_.setpoint_m().value_or(0.0F);
  values.disturbance_m = pilot_.disturbance_m();
  values.position_sd_m = motion_sense_.position_sd_m();
  values.controller_id = settings_.controllers().in_force().controller_id;
  unsigned flags = 0;
  if (channel_.link().lost()) flags |= rheonaut_TELEMETRY_FLAG_LINK_LOSS;
  if (pilot_.lease_lapsed()) flags |= rheonaut_TELEMETRY_FLAG_LEASE_LAPSED;
  if (safety_.outside_limits()) flags |= rheonaut_TELEMETRY_FLAG_POSITION_LIMIT;
  if (settings_.parameters()[ParameterId::model_confirmed] == 1) flags |= rheonaut_TELEMETRY_FLAG_MODEL_CONFIRMED;
  if (motion_sense_.model_mismatch()) flags |= rheonaut_TELEMETRY_FLAG_MODEL_MISMATCH;
  if (!inputs_are_sound_ || sensor_fault_stands()) flags |= rheonaut_TELEMETRY_FLAG_SENSOR_FAULT;
  values.flags = static_cast<std::uint16_t>(flags);
  return values;
}

protocol::Mode Robot::mode() const {
  if (safety_.latched()) return rheonaut_MODE_EMERGENCY;
  return pilot_.is_auto() ? rheonaut_MODE_AUTO : rheonaut_MODE_MANUAL;
}

// The motor is off from here on, not only from the next tick.
void Robot::stop_motion(protocol::EventCause cause, std::uint64_t command_id) {
  const bool was_delivering = pilot_.delivering();
  const float delivered_s = was_delivering ? pilot_.end_delivery(now_us_) : 0;
  pilot_.halt();
  settings_.controllers().reset();
  profile_.restart();
  duty_ = 0;
  if (was_delivering) note(rheonaut_EVENT_KIND_DELIVERY_ENDED, cause, delivered_s, command_id);
}

void Robot::emergency(protocol::EmergencyCause cause, protocol::EventCause event_cause, std::uint64_t command_id) {
  safety_.latch(cause);
  stop_motion(event_cause, command_id);  // SAFETY: off at once, also between ticks
  drop_timed_commands(rejected(rheonaut_REJECT_REASON_LATCHED));
  note(rheonaut_EVENT_KIND_EMERGENCY, event_cause, 0, command_id);
}

// Says which controller is in force when that has changed.
void Robot::announce_controller() {
  if (!settings_.take_controller_news()) return;
  note_controller(rheonaut_EVENT_CAUSE_COMMAND, settings_.controller_command_id());
  channel_.outbox().controller_changed();
}

void Robot::note_controller(protocol::EventCause cause, std::uint64_t command_id) {
  note(rheonaut_EVENT_KIND_CONTROLLER_CHANGED, cause,
       static_cast<float>(settings_.controllers().in_force().controller_id), command_id);
}

void Robot::storage_failed() { note(rheonaut_EVENT_KIND_PARAMETER_CHANGED, rheonaut_EVENT_CAUSE_INTERNAL, 0); }

// Each change is written at the first tick at rest; a write that fails is an event.
void Robot::save_settings() {
  if (config_.storage == nullptr || motor_on()) return;  // SAFETY: writing may block for long
  const auto faults = settings_.save(*config_.storage);
  if (faults.parameters) storage_failed();
  if (faults.controller) note_controller(rheonaut_EVENT_CAUSE_INTERNAL);
}

std::uint32_t Robot::float_state_checksum() const {
  Crc32 crc;
  motion_sense_.add_to(crc);
  settings_.controllers().add_to(crc);
  crc.add_float(reference_m_);
  crc.add_float(duty_);
  return crc.value();
}

void Robot::note(protocol::EventKind kind, protocol::EventCause cause, float value, std::uint64_t command_id) {
  protocol::Event event = rheonaut_Event_init_zero;
  event.event_robot_time_us = now_us_;
  event.kind = kind;
  event.cause = cause;
  event.sample_seq = channel_.samples().next_seq();
  event.mode = mode();
  event.sub_state = mode() == rheonaut_MODE_AUTO ? pilot_.sub_state() : rheonaut_SUB_STATE_NONE;
  event.position_m = seen_motion().position_m;
  event.value = value;
  event.emergency_id = safety_.emergency_id();
  event.command_id = command_id;
  event.emergency_cause = safety_.cause();
  channel_.push(event);
}

}  // namespace robot_fw
