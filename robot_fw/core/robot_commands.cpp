// What each command does, and when it is refused.
#include <algorithm>
#include <cmath>

#include "robot_fw/core/mode_table.hpp"
#include "robot_fw/core/robot.hpp"

namespace robot_fw {
namespace {

bool runs_when_latched(const protocol::Command& command) {
  return refusal_in(rheonaut_MODE_EMERGENCY, command.which_action) == rheonaut_REJECT_REASON_NONE;
}

// SAFETY: stopping the motor at once also drops the commands that wait.
bool is_abort(const protocol::Command& command) {
  return command.which_action == rheonaut_Command_set_duty_tag && command.action.set_duty.duty == 0 &&
         !command.has_execute_at_robot_us;
}

}  // namespace

void Robot::on_command(const protocol::Command& command) {
  const Verdict verdict = filter_.admit(command, now_us_);
  if (!verdict.accepted()) return answer(command.command_id, verdict);
  const bool later = command.has_execute_at_robot_us && command.execute_at_robot_us > now_us_;
  if (!later) {
    const Verdict done = execute(command);
    answer(command.command_id, done);
    if (done.accepted() && is_abort(command)) drop_timed_commands(kTimedExpired);
    return;
  }
  if (safety_.latched() && !runs_when_latched(command)) {
    return answer(command.command_id, rejected(rheonaut_REJECT_REASON_LATCHED));
  }
  // SAFETY: a lease is renewed by a sender who is there now, never by one who was there when it was sent.
  if (command.which_action == rheonaut_Command_renew_lease_tag) {
    return answer(command.command_id, rejected(rheonaut_REJECT_REASON_MALFORMED));
  }
  // SAFETY: what lapsed since the last tick stays lapsed; a new one would begin its lease anew.
  if (timed_.lease_lapsed(now_us_)) drop_timed_commands(kTimedExpired);
  if (!timed_.hold(command, now_us_)) return answer(command.command_id, rejected(rheonaut_REJECT_REASON_BUSY));
  channel_.outbox().ack(ack_for(command.command_id, kAccepted, command.execute_at_robot_us));
}

// SAFETY: a stop needs no boot, no time to live, no mode and no id, and acts before this returns.
void Robot::on_emergency_stop(const protocol::Command& command) {
  const bool repeated = command.command_id != 0 && !filter_.remember(command.command_id);
  if (repeated && safety_.latched()) {
    return channel_.outbox().ack_stop(ack_for(command.command_id, {rheonaut_COMMAND_RESULT_DUPLICATE}, 0));
  }
  emergency(rheonaut_EMERGENCY_CAUSE_OPERATOR, rheonaut_EVENT_CAUSE_COMMAND, command.command_id);
  channel_.outbox().ack_stop(ack_for(command.command_id, kAccepted, now_us_));
}

protocol::CommandAck Robot::ack_for(std::uint64_t command_id, Verdict verdict, std::uint64_t effect_at_us) const {
  protocol::CommandAck ack = rheonaut_CommandAck_init_zero;
  ack.command_id = command_id;
  ack.result = verdict.result;
  ack.reason = verdict.reason;
  ack.effect_at_robot_us = effect_at_us;
  ack.emergency_id = safety_.emergency_id();
  return ack;
}

void Robot::answer(std::uint64_t command_id, Verdict verdict) {
  channel_.outbox().ack(ack_for(command_id, verdict, verdict.accepted() ? now_us_ : 0));
  if (verdict.accepted()) channel_.hurry();
}

// The command was acknowledged when it was admitted; a second ack is only due when it did not run.
void Robot::run_timed_command(const protocol::Command& command) {
  const bool expired = now_us_ > command.valid_until_robot_us;  // SAFETY: a tick that came too late runs nothing stale
  const Verdict verdict = expired ? Verdict{rheonaut_COMMAND_RESULT_EXPIRED} : execute(command);
  if (!verdict.accepted()) answer(command.command_id, verdict);
}

void Robot::drop_timed_commands(Verdict verdict) {
  while (const auto command_id = timed_.drop_any()) answer(*command_id, verdict);
}

Verdict Robot::execute(const protocol::Command& command) {
  const protocol::RejectReason refusal = refusal_in(mode(), command.which_action);  // SAFETY: the table comes first
  if (refusal != rheonaut_REJECT_REASON_NONE) return rejected(refusal);
  const std::uint64_t id = command.command_id;
  switch (command.which_action) {
    case rheonaut_Command_set_mode_tag: return set_mode(command.action.set_mode, id);
    case rheonaut_Command_set_setpoint_tag: return set_setpoint(command.action.set_setpoint.setpoint_m, id);
    case rheonaut_Command_set_duty_tag: return set_duty(command.action.set_duty);
    case rheonaut_Command_renew_lease_tag: return renew_lease(command.action.renew_lease);
    case rheonaut_Command_set_duty_schedule_tag: return set_duty_schedule(command.action.set_duty_schedule);
    case rheonaut_Command_clear_emergency_tag: return clear_emergency(command.action.clear_emergency.emergency_id, id);
    case rheonaut_Command_inject_disturbance_tag:
      return inject_disturbance(command.action.inject_disturbance.disturbance_m, id);
    case rheonaut_Command_zero_position_tag: return zero_position(id);
    case rheonaut_Command_ping_tag: return kAccepted;
    case rheonaut_Command_drop_timed_tag: drop_timed_commands(kTimedExpired); return kAccepted;
    case rheonaut_Command_set_controller_tag:
      return announced(settings_.set_controller(command.action.set_controller, pilot_.is_auto(), id));
    case rheonaut_Command_restore_controller_tag: return announced(settings_.restore_controller(pilot_.is_auto(), id));
    case rheonaut_Command_set_parameter_tag: return set_parameter(command.action.set_parameter, id);
    case rheonaut_Command_get_parameters_tag: return get_parameters(command.action.get_parameters.first_index, id);
    default: return rejected(rheonaut_REJECT_REASON_UNSUPPORTED);
  }
}

Verdict Robot::check_position(float position_m) const {
  if (!std::isfinite(position_m)) return rejected(rheonaut_REJECT_REASON_NOT_FINITE);
  if (std::fabs(position_m) > settings_.parameters()[ParameterId::setpoint_limit_m]) {
    return rejected(rheonaut_REJECT_REASON_OUT_OF_RANGE);
  }
  return kAccepted;
}

Verdict Robot::check_setpoint(float setpoint_m) const {
  const Verdict verdict = check_position(setpoint_m);
  if (!verdict.accepted()) return verdict;
  if (position_limits().contain(setpoint_m)) return check_certainty(setpoint_m);
  // SAFETY: nothing sends the robot beyond its limits, and outside them only back in.
  return rejected(safety_.outside_limits() ? rheonaut_REJECT_REASON_OUTWARD : rheonaut_REJECT_REASON_OUT_OF_RANGE);
}

// SAFETY: nothing sends the robot nearer to a limit than its position is known.
Verdict Robot::check_certainty(float setpoint_m) const {
  const PositionLimits limits = position_limits();
  const float margin_m = 2 * motion_sense_.position_sd_m();
  const bool is_certain = setpoint_m <= limits.max_m - margin_m && setpoint_m >= limits.min_m + margin_m;
  return is_certain ? kAccepted : rejected(rheonaut_REJECT_REASON_UNCERTAIN);
}

Verdict Robot::set_mode(const rheonaut_SetMode& order, std::uint64_t command_id) {
  const bool to_auto = order.mode == rheonaut_MODE_AUTO;
  const bool known = to_auto || order.mode == rheonaut_MODE_MANUAL;
  if (!known || order.has_setpoint_m != to_auto) return rejected(rheonaut_REJECT_REASON_MALFORMED);
  if (to_auto) {
    const Verdict verdict = check_setpoint(order.setpoint_m);
    if (!verdict.accepted()) return verdict;
    // SAFETY: nothing steers by a sensor that cannot be believed.
    if (sensor_fault_stands()) return rejected(rheonaut_REJECT_REASON_CAUSE_STANDS);
  }
  const protocol::Mode before = mode();
  stop_motion(rheonaut_EVENT_CAUSE_COMMAND, command_id);  // SAFETY: nothing outlives a change of mode
  drop_timed_commands(rejected(rheonaut_REJECT_REASON_WRONG_MODE));
  if (to_auto && before == rheonaut_MODE_MANUAL) impedance_.arm();  // what manual has found is not delivered to yet
  if (to_auto) pilot_.enter_auto(order.setpoint_m, settings_.parameters()[ParameterId::auto_limit_s], now_us_);
  if (mode() != before) note(rheonaut_EVENT_KIND_MODE_CHANGED, rheonaut_EVENT_CAUSE_COMMAND, 0, command_id);
  if (to_auto) {
    note(rheonaut_EVENT_KIND_SETPOINT_CHANGED, rheonaut_EVENT_CAUSE_COMMAND, order.setpoint_m, command_id);
  }
  return kAccepted;
}

Verdict Robot::set_setpoint(float setpoint_m, std::uint64_t command_id) {
  const Verdict verdict = check_setpoint(setpoint_m);
  if (!verdict.accepted()) return verdict;
  if (pilot_.delivering()) end_delivery(rheonaut_EVENT_CAUSE_COMMAND, command_id);
  pilot_.set_setpoint(setpoint_m);
  profile_.restart();
  note(rheonaut_EVENT_KIND_SETPOINT_CHANGED, rheonaut_EVENT_CAUSE_COMMAND, setpoint_m, command_id);
  return kAccepted;
}

Verdict Robot::set_duty(const rheonaut_SetDuty& order) {
  if (!std::isfinite(order.duty)) return rejected(rheonaut_REJECT_REASON_NOT_FINITE);
  if (!safety_.range().contains(order.duty) || order.lease_ms > protocol::kLeaseMs) {
    return rejected(rheonaut_REJECT_REASON_OUT_OF_RANGE);
  }
  if (safety_.outward(order.duty)) return rejected(rheonaut_REJECT_REASON_OUTWARD);  // SAFETY: outside, only inward
  if (safety_.uncertain(order.duty)) return rejected(rheonaut_REJECT_REASON_UNCERTAIN);
  pilot_.set_duty(order.duty, order.lease_ms, now_us_);
  return kAccepted;
}

Verdict Robot::renew_lease(const rheonaut_RenewLease& order) {
  if (order.lease_ms > protocol::kLeaseMs) return rejected(rheonaut_REJECT_REASON_OUT_OF_RANGE);
  const bool duty_renewed = pilot_.renew_lease(order.lease_ms, now_us_);
  const bool timed_renewed = timed_.renew_lease(order.lease_ms, now_us_);
  return duty_renewed || timed_renewed ? kAccepted : rejected(rheonaut_REJECT_REASON_NOTHING_TO_RENEW);
}

Verdict Robot::set_duty_schedule(const rheonaut_SetDutySchedule& order) {
  if (order.tick_count == 0 || order.tick_count != order.duty_count) return rejected(rheonaut_REJECT_REASON_MALFORMED);
  for (pb_size_t i = 0; i < order.duty_count; ++i) {
    if (!std::isfinite(order.duty[i])) return rejected(rheonaut_REJECT_REASON_NOT_FINITE);
    if (!safety_.range().contains(order.duty[i])) return rejected(rheonaut_REJECT_REASON_OUT_OF_RANGE);
    if (i > 0 && order.tick[i] <= order.tick[i - 1]) return rejected(rheonaut_REJECT_REASON_MALFORMED);
  }
  if (order.duty[order.duty_count - 1] != 0) return rejected(rheonaut_REJECT_REASON_MALFORMED);
  const bool leads_out =
      std::any_of(order.duty, order.duty + order.duty_count, [this](float duty) { return safety_.outward(duty); });
  if (leads_out) return rejected(rheonaut_REJECT_REASON_OUTWARD);  // SAFETY: outside, only inward
  const bool is_uncertain =
      std::any_of(order.duty, order.duty + order.duty_count, [this](float duty) { return safety_.uncertain(duty); });
  if (is_uncertain) return rejected(rheonaut_REJECT_REASON_UNCERTAIN);
  pilot_.set_schedule(order, now_us_);
  return kAccepted;
}

Verdict Robot::clear_emergency(std::uint64_t emergency_id, std::uint64_t command_id) {
  if (emergency_id != safety_.emergency_id()) return rejected(rheonaut_REJECT_REASON_OTHER_EMERGENCY);
  const bool sensor_cause_stands = safety_.has_sensor_cause() && sensor_fault_stands();
  // SAFETY: nobody clears anything while the motor's supply is cut, or the robot would move when it is back.
  const bool cause_stands = sensor_cause_stands || inputs_.motor_supply_is_cut;
  if (!inputs_are_sound_ || cause_stands) return rejected(rheonaut_REJECT_REASON_CAUSE_STANDS);
  safety_.clear(emergency_id);  // into manual at rest: the stop ended every order, and the latch let none in
  note(rheonaut_EVENT_KIND_EMERGENCY_CLEARED, rheonaut_EVENT_CAUSE_COMMAND, 0, command_id);
  return kAccepted;
}

Verdict Robot::inject_disturbance(float disturbance_m, std::uint64_t command_id) {
  const Verdict verdict = check_position(disturbance_m);
  if (!verdict.accepted()) return verdict;
  pilot_.set_disturbance(disturbance_m);
  note(rheonaut_EVENT_KIND_DISTURBANCE, rheonaut_EVENT_CAUSE_COMMAND, disturbance_m, command_id);
  return kAccepted;
}

Verdict Robot::zero_position(std::uint64_t command_id) {
  if (motor_on()) return rejected(rheonaut_REJECT_REASON_MOTOR_ON);
  const float before_m = motion_sense_.motion().position_m;
  if (!std::isfinite(before_m)) return rejected(rheonaut_REJECT_REASON_NOT_FINITE);
  motion_sense_.zero_position();
  safety_.leaves_limits(0, position_limits());  // what is ordered next need not wait for the next tick
  safety_.watch_certainty(0, 0, position_limits());
  note(rheonaut_EVENT_KIND_POSITION_ZEROED, rheonaut_EVENT_CAUSE_COMMAND, before_m, command_id);
  return kAccepted;
}

// A controller that the command brought into force is announced before the command is answered.
Verdict Robot::announced(Verdict verdict) {
  if (verdict.accepted()) announce_controller();
  return verdict;
}

Verdict Robot::set_parameter(const rheonaut_SetParameter& order, std::uint64_t command_id) {
  const auto index = Parameters::find(order.name);
  if (!index) return rejected(rheonaut_REJECT_REASON_UNKNOWN_PARAMETER);
  if (!std::isfinite(order.value)) return rejected(rheonaut_REJECT_REASON_NOT_FINITE);
  if (!Parameters::in_range(*index, order.value)) return rejected(rheonaut_REJECT_REASON_OUT_OF_RANGE);
  // SAFETY: what shapes or limits motion stays as it is while the motor is on.
  if (Parameters::spec(*index).only_at_rest && motor_on()) return rejected(rheonaut_REJECT_REASON_MOTOR_ON);
  const bool is_estimators = *index >= static_cast<std::size_t>(ParameterId::model_gain_1_m_s);
  // SAFETY: an estimator restarted while the robot coasts would assume that it stands, with a small variance.
  if (is_estimators && !motion_sense_.is_settled()) return rejected(rheonaut_REJECT_REASON_MOTOR_ON);
  // SAFETY: changing a parameter of the model takes its confirmation back; a half-changed model fits no fluid.
  const bool takes_back = Parameters::is_of_model(*index) && settings_.parameters()[ParameterId::model_confirmed] == 1;
  if (!channel_.outbox().has_room_for_pages(takes_back ? 2 : 1)) return rejected(rheonaut_REJECT_REASON_BUSY);
  constexpr auto kConfirmed = static_cast<std::size_t>(ParameterId::model_confirmed);
  settings_.set_parameter(*index, order.value);
  if (takes_back) settings_.set_parameter(kConfirmed, 0);
  if (is_estimators) motion_sense_.set_parameters(settings_.parameters().estimator());
  note(rheonaut_EVENT_KIND_PARAMETER_CHANGED, rheonaut_EVENT_CAUSE_COMMAND, order.value, command_id);
  channel_.outbox().ask_page({command_id, *index, 1});
  if (takes_back) channel_.outbox().ask_page({0, kConfirmed, 1});
  return kAccepted;
}

Verdict Robot::get_parameters(std::uint32_t first_index, std::uint64_t command_id) {
  if (first_index >= kParameterCount) return rejected(rheonaut_REJECT_REASON_OUT_OF_RANGE);
  if (!channel_.outbox().has_room_for_pages(1)) return rejected(rheonaut_REJECT_REASON_BUSY);
  channel_.outbox().ask_page({command_id, first_index, std::min(PageRequest::kMost, kParameterCount - first_index)});
  return kAccepted;
}

PositionLimits Robot::position_limits() const {
  const Parameters& parameters = settings_.parameters();
  return {parameters[ParameterId::position_limit_min_m], parameters[ParameterId::position_limit_max_m]};
}

}  // namespace robot_fw
