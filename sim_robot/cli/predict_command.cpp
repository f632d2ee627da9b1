// Prints the prediction.
#include "sim_robot/cli/predict_command.hpp"

#include <CLI/CLI.hpp>
#include <iostream>

#include "sim_robot/cli/predict.hpp"

namespace sim_robot {

PredictCommand::PredictCommand(CLI::App& app)
    : command_(app.add_subcommand("predict", "compute the closed-loop experiment and print what it measures")) {
  add_duty(*command_, robot_);
  add_fluid(*command_, robot_.world);
  command_->add_flag("--json", json_, "as JSON");
}

bool PredictCommand::chosen() const { return command_->parsed(); }

int PredictCommand::run() const {
  RobotOptions options = robot_;
  options.world.sensor = "perfect";
  std::cout << predict(scenario_of(options).robot, json_);
  return EXIT_SUCCESS;
}

}  // namespace sim_robot
