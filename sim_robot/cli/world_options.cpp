// Declares the flags and puts what they say into a world.
#include "sim_robot/cli/world_options.hpp"

#include <CLI/CLI.hpp>

#include "sim_robot/scenario/model_file.hpp"

namespace sim_robot {

void add_fluid(CLI::App& app, WorldOptions& options) {
  auto* fluid = app.add_option("--fluid", options.fluid,
                               "non_newtonian (29), water (28), water_nonlinear (Section 3.1), shear_thinning")
                    ->check(CLI::IsMember({"non_newtonian", "water", "water_nonlinear", "shear_thinning"}))
                    ->default_str("non_newtonian");
  app.add_option("--model", options.model_file, "model file, or what `rheonaut identify --json` printed")
      ->excludes(fluid);
}

void add_surroundings(CLI::App& app, WorldOptions& options) {
  app.add_option("--mean-flow-m3-s", options.mean_flow_m3_s,
                 "put the robot into the vessel, with this mean flow; negative: backwards");
  app.add_option("--sensor", options.sensor, "bno055: its accelerometer and the estimate; perfect: the true position")
      ->check(CLI::IsMember({"bno055", "perfect"}))
      ->default_str("bno055");
  app.add_option("--seed", options.seed, "of the sensors' noise")->default_str("1");
}

void put(const WorldOptions& options, WorldConfig& world) {
  if (options.fluid) world.plant = fluid(*options.fluid);
  if (options.model_file) world.plant = load_model(*options.model_file);
  if (options.mean_flow_m3_s) {
    if (!world.vessel) world.vessel.emplace();
    world.vessel->pump.mean_flow_m3_s = *options.mean_flow_m3_s;
  }
  if (options.sensor == "perfect") world.imu.reset();
  if (options.sensor == "bno055" && !world.imu) world.imu.emplace();
  if (options.seed) world.seed = *options.seed;
}

}  // namespace sim_robot
