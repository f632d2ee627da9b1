// `rheonaut-sim predict`: the paper's closed-loop experiment, computed.
#pragma once

#include "sim_robot/cli/robot_options.hpp"

namespace sim_robot {

class PredictCommand {
 public:
  explicit PredictCommand(CLI::App& app);  // adds the subcommand

  bool chosen() const;
  int run() const;

 private:
  CLI::App* command_;
  RobotOptions robot_;
  bool json_ = false;
};

}  // namespace sim_robot
