// `rheonaut-sim flow-csv`: one period of the flow for a pump controller.
#pragma once

#include "sim_robot/world/pump.hpp"

namespace CLI {
class App;
}

namespace sim_robot {

class FlowCommand {
 public:
  explicit FlowCommand(CLI::App& app);  // adds the subcommand

  bool chosen() const;
  int run() const;

 private:
  CLI::App* command_;
  double mean_flow_m3_s_ = kPaperFlowM3S;
};

}  // namespace sim_robot
