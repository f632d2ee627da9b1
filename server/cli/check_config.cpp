// `rheonaut check-config`.
#include <fmt/format.h>

#include <cstdio>
#include <exception>

#include "server/cli/command_line.hpp"

namespace server::cli {

int check_config(const CheckConfig& wish) {
  try {
    const Config config = load_config(wish.flags);
    fmt::print("data     {}\n", std::filesystem::absolute(config.data_dir).string());
    fmt::print("http     {}{}\n", config.http, config.http_or_any_port ? " (or a free port)" : "");
    fmt::print("robots   {}{}\n", config.robots, config.robots_or_any_port ? " (or a free port)" : "");
    fmt::print("limits   setpoint {} to {} m, duty {} to {}, disturbance {} m\n", config.limits.setpoint_min_m,
               config.limits.setpoint_max_m, config.limits.duty_min, config.limits.duty_max,
               config.limits.disturbance_max_m);
    fmt::print("the configuration is valid\n");
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "rheonaut: {}\n", error.what());
    return 1;
  }
}

}  // namespace server::cli
