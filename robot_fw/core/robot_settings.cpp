// Judges, changes, loads and saves the settings.
#include "robot_fw/core/robot_settings.hpp"

#include "robot_fw/core/controller_message.hpp"

namespace robot_fw {

RobotSettings::RobotSettings(const DutyRange& motor, std::uint32_t sample_period_us)
    : sample_period_us_(sample_period_us),
      motor_(motor),
      controllers_(adapted(built_in_controller(motor.min), motor, sample_period_us)) {}

Verdict RobotSettings::set_controller(const protocol::Controller& controller, bool moving, std::uint64_t command_id) {
  const protocol::RejectReason fault = fault_of(controller, motor_, sample_period_us_);
  if (fault != rheonaut_REJECT_REASON_NONE) return rejected(fault);
  if (!controllers_.set(sections_of(controller), moving)) return rejected(rheonaut_REJECT_REASON_BUSY);
  controller_command_id_ = command_id;
  return kAccepted;
}

Verdict RobotSettings::restore_controller(bool moving, std::uint64_t command_id) {
  if (!controllers_.restore(moving)) return rejected(rheonaut_REJECT_REASON_WRONG_MODE);
  controller_command_id_ = command_id;
  return kAccepted;
}

RobotSettings::Faults RobotSettings::load(Storage& storage) {
  Faults faults;
  const auto parameters = load_parameters(storage);
  faults.parameters = storage.damaged() || (!parameters && is_kept(storage, StorageKey::parameters));
  parameters_ = parameters.value_or(Parameters{});
  parameters_.set(ParameterId::model_confirmed, 0);  // SAFETY: it may swim in another fluid now
  const auto controller = load_controller(storage);
  // SAFETY: what was kept is judged like what comes over the link; this board may have another motor by now.
  if (!controller || fault_of(*controller, motor_, sample_period_us_) != rheonaut_REJECT_REASON_NONE) {
    faults.controller = is_kept(storage, StorageKey::controller);
    return faults;
  }
  controllers_.set(sections_of(*controller), false);
  controllers_.take_news();
  return faults;
}

RobotSettings::Faults RobotSettings::save(Storage& storage) {
  Faults faults;
  faults.parameters = parameters_unsaved_ && !save_parameters(storage, parameters_);
  if (controller_unsaved_) {
    protocol::Controller controller;
    write_controller(controllers_.in_force(), sample_period_us_, controller);
    faults.controller = !save_controller(storage, controller);
  }
  parameters_unsaved_ = controller_unsaved_ = false;
  return faults;
}

}  // namespace robot_fw
