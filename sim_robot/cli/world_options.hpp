// The flags of rheonaut-sim that set the robot's world.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "sim_robot/world/world.hpp"

namespace CLI {
class App;
}

namespace sim_robot {

// Flags that were given; the others change nothing.
struct WorldOptions {
  std::optional<std::string> fluid;
  std::optional<std::string> model_file;  // in place of the fluid
  std::optional<std::string> sensor;
  std::optional<double> mean_flow_m3_s;  // in the vessel
  std::optional<std::uint64_t> seed;
};

void add_fluid(CLI::App& app, WorldOptions& options);
void add_surroundings(CLI::App& app, WorldOptions& options);

// Applies the given flags to the world. Reads the model's file; throws std::invalid_argument.
void put(const WorldOptions& options, WorldConfig& world);

}  // namespace sim_robot
