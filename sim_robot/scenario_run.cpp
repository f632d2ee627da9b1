// Steps robot, faults and script together.
#include "sim_robot/scenario_run.hpp"

#include <array>
#include <cmath>

#include "control/invalid_argument.hpp"

namespace sim_robot {
namespace {

constexpr int kTicksToRenewal = 10;        // a lease lives longer
constexpr double kHalfTickS = kTickS / 2;  // times are compared with this room for rounding

std::vector<TimedFault> without_outages(const Scenario& scenario) {
  std::vector<TimedFault> others;
  for (const TimedFault& timed : scenario.faults) {
    if (timed.fault.kind != FaultKind::link_outage) others.push_back(timed);
  }
  return others;
}

}  // namespace

ScenarioRun::ScenarioRun(const Scenario& scenario, FaultTimeline::Log log)
    : scenario_(scenario),
      robot_(scenario_.robot),
      station_(robot_),
      faults_(without_outages(scenario_), std::move(log)) {
  for (const auto& [at_s, fault] : scenario_.faults) {
    if (fault.kind == FaultKind::link_outage) outages_.push_back({at_s, at_s + fault.for_s});
  }
  station_.welcome.samples_per_frame = 1;  // so that the last sample is sent in its own tick
}

void ScenarioRun::run() {
  if (scenario_.duration_s <= 0) control::throw_invalid(scenario_.name, ": has no duration_s, so its run has no end");
  while (time_s() < scenario_.duration_s - kHalfTickS) step();
}

void ScenarioRun::step() {
  follow_link();
  faults_.apply_due(robot_);
  if (is_connected_) follow_script();
  station_.step();
}

bool ScenarioRun::link_is_out() const {
  for (const Outage& outage : outages_) {
    if (time_s() >= outage.from_s - kHalfTickS && time_s() < outage.until_s - kHalfTickS) return true;
  }
  return false;
}

void ScenarioRun::follow_link() {
  if (link_is_out() == !is_connected_) return;
  is_connected_ = !is_connected_;
  if (is_connected_) {
    station_.connect();
  } else {
    station_.disconnect();
  }
}

void ScenarioRun::follow_script() {
  while (next_step_ < scenario_.script.size() && scenario_.script[next_step_].at_s <= time_s() + kHalfTickS) {
    say(scenario_.script[next_step_++]);
  }
  renew_duty();
}

void ScenarioRun::say(const ScriptStep& step) {
  const auto setpoint_m = static_cast<float>(step.setpoint_m);
  switch (step.command) {
    case ScriptCommand::set_auto: station_.send(set_auto(setpoint_m)); break;
    case ScriptCommand::set_manual: station_.send(set_manual()); break;
    case ScriptCommand::set_setpoint: station_.send(set_setpoint(setpoint_m)); break;
    case ScriptCommand::inject_disturbance:
      station_.send(inject_disturbance(static_cast<float>(step.disturbance_m)));
      return;
    case ScriptCommand::set_parameter:
      station_.send(set_parameter(step.parameter.c_str(), static_cast<float>(step.value)));
      return;
    case ScriptCommand::zero_position: station_.send(zero_position()); return;
    case ScriptCommand::emergency_stop: station_.send(emergency_stop()); break;
    case ScriptCommand::clear_emergency:
      if (!station_.samples.empty()) station_.send(clear_emergency(station_.samples.rbegin()->second.emergency_id));
      return;
    case ScriptCommand::set_duty:
      duty_ = static_cast<float>(step.duty);
      duty_until_s_ = step.at_s + step.for_s;
      ticks_to_renewal_ = 0;
      return;
  }
  duty_until_s_ = 0;  // another command for the motor ends the duty
}

void ScenarioRun::renew_duty() {
  if (duty_until_s_ == 0) return;
  if (time_s() >= duty_until_s_ - kHalfTickS) {
    duty_until_s_ = 0;
    station_.send(set_duty(0));
  } else if (ticks_to_renewal_-- == 0) {
    station_.send(set_duty(duty_));
    ticks_to_renewal_ = kTicksToRenewal - 1;
  }
}

std::vector<std::uint8_t> ScenarioRun::bytes() const {
  std::vector<std::uint8_t> all;
  std::array<std::uint8_t, protocol::kMaxFramedBytes> buffer;
  for (const protocol::RobotFrame& frame : station_.frames) {
    const std::size_t size = protocol::write_frame(frame, buffer.data(), buffer.size());
    all.insert(all.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size));
  }
  return all;
}

}  // namespace sim_robot
