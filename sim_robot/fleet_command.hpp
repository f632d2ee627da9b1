// The command line of fleets: `rheonaut-sim --robots N` and `rheonaut-sim replay`.
#pragma once

#include <CLI/CLI.hpp>

#include "sim_robot/fleet_run.hpp"

namespace sim_robot {

// Options that a fleet has beyond those of one robot.
class FleetCommand {
 public:
  // Adds the options to `app`, and `replay` as a subcommand of it.
  explicit FleetCommand(CLI::App& app);

  bool is_fleet() const { return robots_->count() > 0; }
  bool is_replay() const { return replay_->parsed(); }

  // `id_is_given`: the robot's name is the prefix of the fleet's, otherwise that is `sim`.
  int run(const std::string& station, const SimulatedRobotConfig& kind, bool id_is_given);
  int replay();

 private:
  void add_shared(CLI::App& to);

  FleetOptions options_;
  CLI::App* replay_ = nullptr;
  CLI::Option* robots_ = nullptr;
  std::string station_, token_, frames_;
  double rate_ = 1;
  std::uint32_t samples_per_frame_ = 10;
  std::uint64_t seed_ = 1;
};

}  // namespace sim_robot
