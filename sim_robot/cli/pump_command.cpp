// The pump is set by a fault of the kind pump_flow, which stays in force.
#include "sim_robot/cli/pump_command.hpp"

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <iostream>
#include <nlohmann/json.hpp>

#include "sim_robot/client/fault_client.hpp"
#include "sim_robot/client/fault_server.hpp"

namespace sim_robot {

PumpCommand::PumpCommand(CLI::App& app)
    : command_(app.add_subcommand("pump", "set the pump of a simulated robot that runs with --faults")) {
  command_->add_option("flow", flow_, "off, constant or pulse_70_bpm, as a profile's conditions.pump")->required();
  command_->add_option("--mean-flow-m-s", mean_flow_m_s_, "mean velocity in the tube that the robot is in")
      ->capture_default_str();
  command_->add_option("--faults", faults_at_, "ADDR:PORT of the running robot's --faults")->required();
  command_->footer("Example: rheonaut-sim pump constant --mean-flow-m-s 0.04 --faults 127.0.0.1:7400");
}

bool PumpCommand::chosen() const { return command_->parsed(); }

int PumpCommand::run() const {
  const nlohmann::json fault{{"fault", "pump_flow"}, {"pump", flow_}, {"mean_flow_m_s", mean_flow_m_s_}};
  post_fault(parse_faults_address(faults_at_, true), fault.dump());
  std::cout << "pump: " << flow_ << ", " << mean_flow_m_s_ << " m/s\n";
  return EXIT_SUCCESS;
}

}  // namespace sim_robot
