// Steps the lab and follows the script.
#include "sim_robot/lab/scenario_run.hpp"

#include <array>
#include <cmath>

#include "base/invalid_argument.hpp"
#include "sim_robot/lab/station_commands.hpp"

namespace sim_robot {
namespace {

constexpr int kTicksToRenewal = 10;        // a lease lives longer
constexpr double kHalfTickS = kTickS / 2;  // times are compared with this room for rounding

LinkOptions perfect_link(const Scenario& scenario) {
  LinkOptions options;
  options.seed = scenario.robot.world.seed;  // of the faults' chance and the pauses before it dials again
  return options;
}

}  // namespace

ScenarioRun::ScenarioRun(const Scenario& scenario, FaultTimeline::Log log)
    : scenario_(scenario), lab_(scenario_.robot, perfect_link(scenario_), scenario_.faults, std::move(log)) {
  lab_.station.welcome.samples_per_frame = 1;  // so that the last sample is sent in its own tick
}

void ScenarioRun::run() {
  if (scenario_.duration_s <= 0) base::throw_invalid(scenario_.name, ": has no duration_s, so its run has no end");
  while (time_s() < scenario_.duration_s - kHalfTickS) step();
}

void ScenarioRun::step() {
  if (lab_.station.link_is_up()) follow_script();
  const auto boot = static_cast<std::size_t>(life().boots());
  true_position_m_.emplace(std::pair{boot, robot().robot_time_us()}, robot().world().position_m());
  lab_.step();
}

// A fast clock may tick twice in a step: then that of the second one.
double ScenarioRun::true_position_m(std::size_t boot, std::uint64_t robot_time_us) const {
  const auto found = true_position_m_.lower_bound({boot, robot_time_us});
  return found == true_position_m_.end() ? robot().world().position_m() : found->second;
}

void ScenarioRun::follow_script() {
  while (next_step_ < scenario_.script.size() && scenario_.script[next_step_].at_s <= time_s() + kHalfTickS) {
    say(scenario_.script[next_step_++]);
  }
  renew_duty();
}

void ScenarioRun::say(const ScriptStep& step) {
  LinkedPeer& station = lab_.station;
  const auto setpoint_m = static_cast<float>(step.setpoint_m);
  switch (step.command) {
    case ScriptCommand::set_auto: station.send(set_auto(setpoint_m)); break;
    case ScriptCommand::set_manual: station.send(set_manual()); break;
    case ScriptCommand::set_setpoint: station.send(set_setpoint(setpoint_m)); break;
    case ScriptCommand::inject_disturbance:
      station.send(inject_disturbance(static_cast<float>(step.disturbance_m)));
      return;
    case ScriptCommand::set_parameter:
      station.send(set_parameter(step.parameter.c_str(), static_cast<float>(step.value)));
      return;
    case ScriptCommand::zero_position: station.send(zero_position()); return;
    case ScriptCommand::emergency_stop: station.send(emergency_stop()); break;
    case ScriptCommand::clear_emergency: station.send(clear_emergency(emergency_id())); return;
    case ScriptCommand::set_duty:
      duty_ = static_cast<float>(step.duty);
      duty_until_s_ = time_s() + step.for_s;
      ticks_to_renewal_ = 0;
      return;
  }
  duty_until_s_ = 0;  // another command for the motor ends the duty
}

// The last one that the station received; 0: none.
std::uint64_t ScenarioRun::emergency_id() const {
  const LinkedPeer& station = lab_.station;
  if (!station.samples.empty()) return station.samples.rbegin()->second.emergency_id;
  return station.hello ? station.hello->emergency_id : 0;
}

void ScenarioRun::renew_duty() {
  if (duty_until_s_ == 0) return;
  if (time_s() >= duty_until_s_ - kHalfTickS) {
    duty_until_s_ = 0;
    lab_.station.send(set_duty(0));
  } else if (ticks_to_renewal_-- == 0) {
    lab_.station.send(set_duty(duty_));
    ticks_to_renewal_ = kTicksToRenewal - 1;
  }
}

std::vector<std::uint8_t> ScenarioRun::bytes() const {
  std::vector<std::uint8_t> all;
  std::array<std::uint8_t, protocol::kMaxFramedBytes> buffer;
  for (const protocol::RobotFrame& frame : lab_.station.frames) {
    const std::size_t size = protocol::write_frame(frame, buffer.data(), buffer.size());
    all.insert(all.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size));
  }
  return all;
}

}  // namespace sim_robot
