// `rheonaut-sim play`: a scenario with its script in virtual time, as CSV.
#pragma once

#include <iosfwd>

#include "sim_robot/cli/robot_options.hpp"
#include "sim_robot/lab/scenario_run.hpp"

namespace sim_robot {

class PlayCommand {
 public:
  explicit PlayCommand(CLI::App& app);  // adds the subcommand

  bool chosen() const;
  int run() const;

 private:
  CLI::App* command_;
  RobotOptions robot_;
  std::string scenario_;
};

}  // namespace sim_robot
