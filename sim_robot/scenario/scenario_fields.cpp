// The keys of a scenario: its own, those of the script, and where the world's and the faults' stand.
#include <algorithm>
#include <array>

#include "base/invalid_argument.hpp"
#include "sim_robot/scenario/scenario.hpp"
#include "sim_robot/scenario/world_fields.hpp"

namespace sim_robot {
namespace {

constexpr std::array<const char*, 9> kCommands{"set_auto",      "set_manual",         "set_setpoint",
                                               "set_duty",      "inject_disturbance", "set_parameter",
                                               "zero_position", "emergency_stop",     "clear_emergency"};

constexpr Range kRunTimes{0, 1e9};

void robot_fields(Fields& fields, SimulatedRobotConfig& robot) {
  double duty_min = static_cast<double>(robot.duty.min), duty_max = static_cast<double>(robot.duty.max);
  fields.text("id", robot.robot_id, "name, 1 to 31 of [a-z0-9_-]");
  fields.number("duty_min", duty_min, {-1, 0}, "lowest duty of the motor");
  fields.number("duty_max", duty_max, {0, 1}, "highest duty of the motor, above 0");
  fields.number("clock_drift_ppm", robot.clock_drift_ppm, {-100'000, 100'000},
                "of its clock against true time; fast is positive");
  robot.duty = {static_cast<float>(duty_min), static_cast<float>(duty_max)};
  fields.must([&robot] { check(robot); });
}

// Behind those of the same time.
template <class Timed>
void insert_by_time(std::vector<Timed>& all, const Timed& one) {
  all.insert(std::ranges::upper_bound(all, one.at_s, {}, &Timed::at_s), one);
}

// Nothing may come behind the end.
void check_time(double at_s, double duration_s) {
  if (duration_s > 0 && at_s >= duration_s) {
    base::throw_invalid("at_s is ", at_s, ", when the scenario has ended; its duration_s is ", duration_s);
  }
}

}  // namespace

std::span<const char* const> script_commands() { return kCommands; }

void fields(Fields& fields, ScriptStep& step) {
  switch (step.command) {
    case ScriptCommand::set_auto:
    case ScriptCommand::set_setpoint: return fields.number("setpoint_m", step.setpoint_m, {-100, 100}, "where to");
    case ScriptCommand::set_duty:
      fields.number("duty", step.duty, {-1, 1}, "of the motor");
      return fields.number("for_s", step.for_s, {0.01, kForEver}, "then the motor stops; or until the next command");
    case ScriptCommand::inject_disturbance:
      return fields.number("disturbance_m", step.disturbance_m, {-100, 100}, "added to the measured position");
    case ScriptCommand::set_parameter:
      fields.text("parameter", step.parameter, "its name, see robot.md");
      return fields.number("value", step.value, {-1e9, 1e9}, "what it becomes");
    default: return;
  }
}

void fields(Fields& fields, Scenario& scenario) {
  fields.text("description", scenario.description, "one line for people");
  fields.number("duration_s", scenario.duration_s, {0, 1e9}, "the run ends by itself; 0: for ever");
  fields.whole("seed", scenario.robot.world.seed, {0, 9e18}, "of the sensors' noise");
  fields.table("robot", "", [&scenario](Fields& inside) { robot_fields(inside, scenario.robot); });
  world_fields(fields, scenario.robot.world);
  const auto fault_inside = [&scenario](Fields& inside) {
    TimedFault timed;
    inside.number("at_s", timed.at_s, kRunTimes, "time of the run");
    fields_with_kind(inside, timed.fault);
    inside.must([&timed, &scenario] {
      check_time(timed.at_s, scenario.duration_s);
      check(timed.fault, scenario.robot.world);
    });
    insert_by_time(scenario.faults, timed);
  };
  fields.tables("faults", "", fault_inside);
  const auto step_inside = [&scenario](Fields& inside) {
    ScriptStep step;
    inside.number("at_s", step.at_s, kRunTimes, "time of the run");
    std::size_t index = kCommands.size();
    inside.choice("command", index, kCommands, "what a station says to the robot");
    step.command = static_cast<ScriptCommand>(index < kCommands.size() ? index : 0);
    sim_robot::fields(inside, step);
    inside.must([&step, &scenario] { check_time(step.at_s, scenario.duration_s); });
    insert_by_time(scenario.script, step);
  };
  fields.tables("script", "", step_inside);
}

}  // namespace sim_robot
