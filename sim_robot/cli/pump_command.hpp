// `rheonaut-sim pump`: sets the pump of a simulated robot that runs.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace sim_robot {

class PumpCommand {
 public:
  explicit PumpCommand(CLI::App& app);  // adds the subcommand

  bool chosen() const;
  int run() const;

 private:
  CLI::App* command_;
  std::string flow_, faults_at_;
  double mean_flow_m_s_ = 0;
};

}  // namespace sim_robot
