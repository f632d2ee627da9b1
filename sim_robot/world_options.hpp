// The flags of rheonaut-sim that say what world the robot is in.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "sim_robot/world.hpp"

namespace CLI {
class App;
}

namespace sim_robot {

struct WorldOptions {
  std::string fluid = "non_newtonian";
  std::string model_file;  // in place of the fluid
  std::string sensor = "bno055";
  std::optional<double> mean_flow_m3_s;  // given: in the vessel
  std::uint64_t seed = 1;
};

void add_fluid(CLI::App& app, WorldOptions& options);
void add_surroundings(CLI::App& app, WorldOptions& options);

// Reads the model's file; throws std::invalid_argument.
WorldConfig world_of(const WorldOptions& options);

}  // namespace sim_robot
