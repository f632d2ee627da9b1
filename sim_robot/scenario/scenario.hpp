// A scenario: a robot in its world, its faults by time, and the commands of an experiment. A TOML file.
//
// docs/scenarios.md lists the keys. Errors are std::invalid_argument, `file:line:column: key: what is wrong`, with the
// value and what is allowed; unknown keys are errors too.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/embedded_file.hpp"
#include "sim_robot/faults/fault.hpp"
#include "sim_robot/robot/simulated_robot.hpp"

namespace sim_robot {

struct TimedFault {
  double at_s = kMustBeGiven;  // true time since the run began
  Fault fault;
};

// What a station does in the experiment. In the order of script_commands().
enum class ScriptCommand {
  set_auto,
  set_manual,
  set_setpoint,
  set_duty,
  inject_disturbance,
  set_parameter,
  zero_position,
  emergency_stop,
  clear_emergency,
};
std::span<const char* const> script_commands();

struct ScriptStep {
  double at_s = kMustBeGiven;
  ScriptCommand command = ScriptCommand::set_auto;
  double setpoint_m = kMustBeGiven;
  double duty = kMustBeGiven;
  double for_s = kForEver;  // the duty's lease is renewed for so long, or until the next step with a duty
  double disturbance_m = kMustBeGiven;
  std::string parameter{};
  double value = kMustBeGiven;
};

struct Scenario {
  std::string name;  // of the file, without .toml
  std::string description = "no description";
  SimulatedRobotConfig robot;
  double duration_s = 0;           // 0: for ever
  std::vector<TimedFault> faults;  // by time
  std::vector<ScriptStep> script;  // by time; a simulated robot that dials a station leaves it to the station
};

// `name` stands for the text in errors.
Scenario parse_scenario(std::string_view text, const std::string& name);
Scenario load_scenario(const std::filesystem::path& file);

// Every key that parse_scenario() takes.
void fields(Fields& fields, Scenario& scenario);
void fields(Fields& fields, ScriptStep& step);

// The built-in scenarios, by name: the files of sim_robot/scenarios/ without their ending.
std::span<const base::EmbeddedFile> scenario_files();
// A built-in scenario by its name, otherwise a file; throws std::invalid_argument that lists the built-in ones.
Scenario find_scenario(const std::string& name_or_file);

}  // namespace sim_robot
