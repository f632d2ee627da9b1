// `rheonaut-sim replay …`: many robots that send recorded telemetry, for load tests.
#pragma once

#include <CLI/CLI.hpp>

#include "sim_robot/cli/station_options.hpp"
#include "sim_robot/fleet/fleet_run.hpp"

namespace sim_robot {

class ReplayCommand {
 public:
  explicit ReplayCommand(CLI::App& app);  // adds the subcommand

  bool chosen() const { return command_->parsed(); }
  // Until SIGINT or SIGTERM, or the end of the duration; returns the exit status.
  int run();

 private:
  CLI::App* command_;
  FleetOptions options_;
  StationOptions station_;
  std::string token_, frames_;
  double rate_ = 1;
  std::uint32_t samples_per_frame_ = 10;
  std::uint64_t seed_ = 1;
};

}  // namespace sim_robot
