// `rheonaut-sim proxy`: the proxy as a program, controlled by lines on its standard input.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "sim_robot/network/impairment.hpp"

namespace sim_robot {

class ProxyCommand {
 public:
  explicit ProxyCommand(CLI::App& app);  // adds the subcommand

  bool chosen() const { return command_->parsed(); }
  // Until SIGINT or SIGTERM; returns the exit status. Throws for wrong arguments or a taken port.
  int run() const;

 private:
  CLI::App* command_;
  std::string listen_ = "127.0.0.1:0", target_;
  double delay_ms_ = 0, jitter_ms_ = 0;
  Impairment impairment_;
  std::vector<std::string> outages_;
  std::uint64_t seed_ = 1;
};

}  // namespace sim_robot
