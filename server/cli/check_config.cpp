// `rheonaut check-config`.
#include <fmt/format.h>
#include <fmt/ostream.h>

#include <algorithm>
#include <filesystem>

#include "server/cli/command_line.hpp"

namespace server::cli {
namespace {

std::string or_none(std::uint32_t value, const char* unit, const char* none) {
  return value == 0 ? none : fmt::format("{} {}", value, unit);
}

void print_recording(const config::RecordingConfig& recording, std::ostream& out) {
  fmt::print(out, "keep     {}, database {}, warning below {} MB free, nothing new below {} MB\n",
             or_none(recording.retention_days, "days", "for ever"),
             or_none(recording.max_database_mb, "MB", "without limit"), recording.low_space_mb,
             recording.critical_space_mb);
}

// What keeps others from reading and changing what is sent.
std::string protection(const config::Config& config, const std::string& listen) {
  if (config.speaks_tls(listen)) return "TLS with " + config.tls_certificate().string();
  return config.is_exposed(listen) ? "PLAIN on a reachable address" : "plain on loopback";
}

}  // namespace

int run(const CheckConfig& line, std::ostream& out) {
  const config::Config config = load_config(line.flags);
  fmt::print(out, "data     {}\n", std::filesystem::absolute(config.data_dir).string());
  fmt::print(out, "http     {}{}\n", config.http, config.http_or_any_port ? " (or a free port)" : "");
  fmt::print(out, "robots   {}{}\n", config.robots, config.robots_or_any_port ? " (or a free port)" : "");
  fmt::print(out, "places   http {}, {} of an address; robots {}, {} of an address\n", config.http_places.connections,
             config.http_places.of_address, config.robot_places.connections, config.robot_places.of_address);
  fmt::print(out, "tls      http {}, robots {}\n", protection(config, config.http), protection(config, config.robots));
  const auto print_limits = [&out](const std::string& title, const config::CommandLimits& limits) {
    fmt::print(out, "{}setpoint {} to {} m in steps of {} m, duty {} to {}, above {} for {} s, disturbance {} m\n",
               title, limits.setpoint_min_m, limits.setpoint_max_m, limits.setpoint_step_m, limits.duty_min,
               limits.duty_max, limits.power_duty, limits.power_s, limits.disturbance_max_m);
  };
  print_limits("limits   ", config.envelope.anywhere());
  for (const auto& [fluid, limits] : config.envelope.of_fluid()) {
    const bool is_built_in =
        std::ranges::find(config::Envelope::kBuiltInFluids, fluid) != config::Envelope::kBuiltInFluids.end();
    print_limits(fmt::format("fluid    {}{}: ", one_line(fluid), is_built_in ? "" : " (of this configuration)"),
                 limits);
  }
  print_limits("fluid    not known: ", config.envelope.strictest());
  print_recording(config.recording, out);
  fmt::print(out, "log      from level {} on, as {}\n", config.log_level,
             config.log_format == "json" ? "JSON, one object a line" : "text");
  fmt::print(out, "the configuration is valid\n");
  return 0;
}

}  // namespace server::cli
