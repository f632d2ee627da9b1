// `rheonaut-sim scenarios`: lists the built-in scenarios.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace sim_robot {

class ScenariosCommand {
 public:
  explicit ScenariosCommand(CLI::App& app);  // adds the subcommand

  bool chosen() const;
  int run() const;

 private:
  CLI::App* command_;
  std::string shown_, checked_;
  bool keys_ = false;
};

}  // namespace sim_robot
