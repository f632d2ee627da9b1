// The flags of rheonaut-sim that choose a scenario and override its keys.
#pragma once

#include <optional>
#include <string>

#include "sim_robot/cli/world_options.hpp"
#include "sim_robot/scenario/scenario.hpp"

namespace sim_robot {

struct RobotOptions {
  std::optional<std::string> scenario;  // a name or a file; without: a robot in the fabric softener, for ever
  WorldOptions world;
  std::optional<float> duty_min, duty_max;
  std::optional<std::string> id, token, boot_id;
  std::optional<std::uint32_t> samples_per_frame;
  std::optional<double> clock_drift_ppm, duration_s;
};

void add_duty(CLI::App& app, RobotOptions& options);
// Everything but --scenario.
void add_robot(CLI::App& app, RobotOptions& options);

// The scenario with the flags applied, checked; the boot id is random unless it was given. Throws
// std::invalid_argument.
Scenario scenario_of(const RobotOptions& options);

}  // namespace sim_robot
