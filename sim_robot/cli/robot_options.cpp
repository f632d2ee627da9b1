// Declares the flags and makes a scenario of them.
#include "sim_robot/cli/robot_options.hpp"

#include <CLI/CLI.hpp>
#include <cmath>

#include "base/invalid_argument.hpp"

namespace sim_robot {
namespace {

// The flags may have taken away what a fault needs.
void check_faults(const Scenario& scenario) {
  for (const TimedFault& timed : scenario.faults) {
    try {
      check(timed.fault, scenario.robot.world);
    } catch (const std::invalid_argument& error) {
      base::throw_invalid("scenario ", scenario.name, ", fault at ", timed.at_s, " s: ", error.what());
    }
  }
}

}  // namespace

void add_duty(CLI::App& app, RobotOptions& options) {
  app.add_option("--duty-min", options.duty_min, "lowest duty of the motor, in [-1, 0]")->default_str("-1");
  app.add_option("--duty-max", options.duty_max, "highest duty of the motor, in (0, 1]")->default_str("1");
}

void add_robot(CLI::App& app, RobotOptions& options) {
  add_duty(app, options);
  add_fluid(app, options.world);
  add_surroundings(app, options.world);
  app.add_option("--id", options.id, "name of the robot, 1 to 31 of [a-z0-9_-]")->default_str("sim-1");
  app.add_option("--boot-id", options.boot_id, "fixed boot id in hexadecimal instead of a random one");
  app.add_option("--samples-per-frame", options.samples_per_frame, "of telemetry, 1 to 25")->default_str("5");
  app.add_option("--clock-drift-ppm", options.clock_drift_ppm, "of its clock against true time; fast is positive")
      ->default_str("0")
      ->type_name("PPM");
  app.add_option("--duration-s", options.duration_s, "end by itself after so long; 0: never")
      ->check(CLI::Range(0.0, 1e9))
      ->type_name("S");
}

Scenario scenario_of(const RobotOptions& options) {
  Scenario scenario;
  scenario.robot.world.imu.emplace();
  if (options.scenario) scenario = find_scenario(*options.scenario);
  SimulatedRobotConfig& robot = scenario.robot;
  put(options.world, robot.world);
  if (options.duty_min) robot.duty.min = *options.duty_min;
  if (options.duty_max) robot.duty.max = *options.duty_max;
  if (options.id) robot.robot_id = *options.id;
  if (options.samples_per_frame) robot.samples_per_frame = *options.samples_per_frame;
  if (options.clock_drift_ppm) robot.clock_drift_ppm = *options.clock_drift_ppm;
  if (options.token) robot.token = *options.token;
  if (options.duration_s) scenario.duration_s = *options.duration_s;
  if (!std::isfinite(scenario.duration_s)) base::throw_invalid("--duration-s: ", scenario.duration_s, " is not a time");
  robot.boot_id = options.boot_id ? parse_boot_id(*options.boot_id) : random_boot_id();
  check(robot);
  check_faults(scenario);
  return scenario;
}

}  // namespace sim_robot
