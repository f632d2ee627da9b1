// Parameters and controllers: taken from the station, answered, and kept over resets.
#include <algorithm>
#include <cmath>

#include "robot_fw/core/controller_message.hpp"
#include "robot_fw/core/robot.hpp"

namespace robot_fw {

Verdict Robot::set_controller(const protocol::Controller& controller, std::uint64_t command_id) {
  const protocol::RejectReason fault = fault_of(controller, safety_.range(), config_.sample_period_us);
  if (fault != rheonaut_REJECT_REASON_NONE) return rejected(fault);
  if (!controllers_.set(sections_of(controller), pilot_.is_auto())) return rejected(rheonaut_REJECT_REASON_BUSY);
  controller_command_id_ = command_id;
  announce_controller();
  return kAccepted;
}

Verdict Robot::restore_controller(std::uint64_t command_id) {
  if (!controllers_.restore(pilot_.is_auto())) return rejected(rheonaut_REJECT_REASON_WRONG_MODE);
  controller_command_id_ = command_id;
  announce_controller();
  return kAccepted;
}

// Says which controller is in force when that has changed.
void Robot::announce_controller() {
  if (!controllers_.take_news()) return;
  note(rheonaut_EVENT_KIND_CONTROLLER_CHANGED, rheonaut_EVENT_CAUSE_COMMAND,
       static_cast<float>(controllers_.in_force().controller_id), controller_command_id_);
  outbox_.controller_changed();
  controller_unsaved_ = true;
}

Verdict Robot::set_parameter(const rheonaut_SetParameter& order, std::uint64_t command_id) {
  const auto index = Parameters::find(order.name);
  if (!index) return rejected(rheonaut_REJECT_REASON_UNKNOWN_PARAMETER);
  if (!std::isfinite(order.value)) return rejected(rheonaut_REJECT_REASON_NOT_FINITE);
  if (!Parameters::in_range(*index, order.value)) return rejected(rheonaut_REJECT_REASON_OUT_OF_RANGE);
  // SAFETY: what shapes or limits motion stays as it is while the motor is on.
  if (Parameters::spec(*index).only_at_rest && motor_on()) return rejected(rheonaut_REJECT_REASON_MOTOR_ON);
  const bool is_estimators = *index >= static_cast<std::size_t>(ParameterId::model_gain_1_m_s);
  // SAFETY: an estimator that starts anew while the robot coasts would take it to stand, and be sure of that.
  if (is_estimators && !motion_sense_.is_settled()) return rejected(rheonaut_REJECT_REASON_MOTOR_ON);
  // SAFETY: whoever changes the model says anew that it is the fluid's; one that is half of another is nobody's.
  const bool takes_back = Parameters::is_of_model(*index) && parameters_[ParameterId::model_confirmed] == 1;
  if (!outbox_.has_room_for_pages(takes_back ? 2 : 1)) return rejected(rheonaut_REJECT_REASON_BUSY);
  parameters_.set(*index, order.value);
  if (takes_back) parameters_.set(ParameterId::model_confirmed, 0);
  if (is_estimators) motion_sense_.set_parameters(parameters_.estimator());
  parameters_unsaved_ = true;
  note(rheonaut_EVENT_KIND_PARAMETER_CHANGED, rheonaut_EVENT_CAUSE_COMMAND, order.value, command_id);
  outbox_.ask_page({command_id, *index, 1});
  constexpr auto kConfirmed = static_cast<std::uint32_t>(ParameterId::model_confirmed);
  if (takes_back) outbox_.ask_page({0, kConfirmed, 1});
  return kAccepted;
}

Verdict Robot::get_parameters(std::uint32_t first_index, std::uint64_t command_id) {
  if (first_index >= kParameterCount) return rejected(rheonaut_REJECT_REASON_OUT_OF_RANGE);
  if (!outbox_.has_room_for_pages(1)) return rejected(rheonaut_REJECT_REASON_BUSY);
  outbox_.ask_page({command_id, first_index, std::min(PageRequest::kMost, kParameterCount - first_index)});
  return kAccepted;
}

PositionLimits Robot::position_limits() const {
  return {parameters_[ParameterId::position_limit_min_m], parameters_[ParameterId::position_limit_max_m]};
}

void Robot::load_settings() {
  if (config_.storage == nullptr) return;
  Storage& storage = *config_.storage;
  const auto parameters = load_parameters(storage);
  if (storage.damaged() || (!parameters && is_kept(storage, StorageKey::parameters))) {
    note(rheonaut_EVENT_KIND_PARAMETER_CHANGED, rheonaut_EVENT_CAUSE_RESET, 0);  // to the defaults
  }
  parameters_ = parameters.value_or(Parameters{});
  parameters_.set(ParameterId::model_confirmed, 0);  // SAFETY: it may swim in another fluid now
  motion_sense_.set_parameters(parameters_.estimator());
  const auto controller = load_controller(storage);
  // SAFETY: what was kept is judged like what comes over the link; this port may have another motor by now.
  if (!controller || fault_of(*controller, safety_.range(), config_.sample_period_us) != rheonaut_REJECT_REASON_NONE) {
    if (is_kept(storage, StorageKey::controller)) {
      note(rheonaut_EVENT_KIND_CONTROLLER_CHANGED, rheonaut_EVENT_CAUSE_RESET,
           static_cast<float>(controllers_.in_force().controller_id));  // the built-in one
    }
    return;
  }
  controllers_.set(sections_of(*controller), false);
  controllers_.take_news();
}

void Robot::storage_failed() { note(rheonaut_EVENT_KIND_PARAMETER_CHANGED, rheonaut_EVENT_CAUSE_INTERNAL, 0); }

// Each change is written once, at the first tick at rest; a write that fails is an event and not tried again.
void Robot::save_settings() {
  if (config_.storage == nullptr || motor_on()) return;  // SAFETY: writing may block for long
  if (parameters_unsaved_ && !save_parameters(*config_.storage, parameters_)) storage_failed();
  if (controller_unsaved_) {
    const ControllerSections& in_force = controllers_.in_force();
    protocol::Controller controller;
    write_controller(in_force, config_.sample_period_us, controller);
    if (!save_controller(*config_.storage, controller)) {
      note(rheonaut_EVENT_KIND_CONTROLLER_CHANGED, rheonaut_EVENT_CAUSE_INTERNAL,
           static_cast<float>(in_force.controller_id));
    }
  }
  parameters_unsaved_ = controller_unsaved_ = false;
}

}  // namespace robot_fw
