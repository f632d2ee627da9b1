// The settings that a station may change and a reset keeps: parameters and controllers, and which are not saved yet.
//
// The owner decides when they may change, and reports changes to the station.
#pragma once

#include <cstdint>

#include "robot_fw/core/commands.hpp"
#include "robot_fw/core/controller_switch.hpp"
#include "robot_fw/core/parameters.hpp"
#include "robot_fw/core/safety.hpp"
#include "robot_fw/core/settings_store.hpp"

namespace robot_fw {

class RobotSettings {
 public:
  // Which of them could not be read or written.
  struct Faults {
    bool parameters = false;
    bool controller = false;
  };

  // The defaults, and a built-in controller for this motor.
  RobotSettings(const DutyRange& motor, std::uint32_t sample_period_us);

  // Takes over what is kept. A fault: something is kept and cannot be used; the default or built-in one stays.
  Faults load(Storage& storage);
  // Writes what changed, once: a write that fails is a fault and not tried again. SAFETY: it may block for long, so the
  // motor must be off.
  Faults save(Storage& storage);

  const Parameters& parameters() const { return parameters_; }
  // The value must be in range.
  void set_parameter(std::size_t index, float value) {
    parameters_.set(index, value);
    parameters_unsaved_ = true;
  }

  ControllerSwitch& controllers() { return controllers_; }
  const ControllerSwitch& controllers() const { return controllers_; }
  Verdict set_controller(const protocol::Controller& controller, bool moving, std::uint64_t command_id);
  Verdict restore_controller(bool moving, std::uint64_t command_id);
  // Whether another controller has come into force since the last call, by controller_command_id().
  bool take_controller_news() {
    if (!controllers_.take_news()) return false;
    controller_unsaved_ = true;
    return true;
  }
  std::uint64_t controller_command_id() const { return controller_command_id_; }

 private:
  Parameters parameters_;
  bool parameters_unsaved_ = false, controller_unsaved_ = false;
  std::uint32_t sample_period_us_;
  DutyRange motor_;
  std::uint64_t controller_command_id_ = 0;  // the last command about the controller
  ControllerSwitch controllers_;
};

}  // namespace robot_fw
