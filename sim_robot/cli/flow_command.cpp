// Prints the flow.
#include "sim_robot/cli/flow_command.hpp"

#include <CLI/CLI.hpp>
#include <iostream>

namespace sim_robot {

FlowCommand::FlowCommand(CLI::App& app)
    : command_(app.add_subcommand("flow-csv", "print one period of the flow for a pump controller")) {
  command_->add_option("--mean-flow-m3-s", mean_flow_m3_s_, "negative: backwards")->capture_default_str();
}

bool FlowCommand::chosen() const { return command_->parsed(); }

int FlowCommand::run() const {
  write_flow_csv(std::cout, mean_flow_m3_s_);
  return EXIT_SUCCESS;
}

}  // namespace sim_robot
