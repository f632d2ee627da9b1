// `rheonaut check-config`.
#include <fmt/format.h>
#include <fmt/ostream.h>

#include <filesystem>

#include "server/cli/command_line.hpp"

namespace server::cli {

int run(const CheckConfig& wish, std::ostream& out) {
  const Config config = load_config(wish.flags);
  fmt::print(out, "data     {}\n", std::filesystem::absolute(config.data_dir).string());
  fmt::print(out, "http     {}{}\n", config.http, config.http_or_any_port ? " (or a free port)" : "");
  fmt::print(out, "robots   {}{}\n", config.robots, config.robots_or_any_port ? " (or a free port)" : "");
  fmt::print(out, "limits   setpoint {} to {} m, duty {} to {}, disturbance {} m\n", config.limits.setpoint_min_m,
             config.limits.setpoint_max_m, config.limits.duty_min, config.limits.duty_max,
             config.limits.disturbance_max_m);
  fmt::print(out, "the configuration is valid\n");
  return 0;
}

}  // namespace server::cli
