// `rheonaut check-config`.
#include <fmt/format.h>
#include <fmt/ostream.h>

#include <filesystem>

#include "server/cli/command_line.hpp"

namespace server::cli {
namespace {

std::string or_none(std::uint32_t value, const char* unit, const char* none) {
  return value == 0 ? none : fmt::format("{} {}", value, unit);
}

void print_recording(const RecordingConfig& recording, std::ostream& out) {
  fmt::print(out, "keep     {}, database {}, warning below {} MB free, nothing new below {} MB\n",
             or_none(recording.retention_days, "days", "for ever"),
             or_none(recording.max_database_mb, "MB", "without limit"), recording.low_space_mb,
             recording.critical_space_mb);
}

// What keeps others from reading and changing what is sent.
std::string protection(const Config& config, const std::string& listen) {
  if (config.speaks_tls(listen)) return "TLS with " + config.tls_certificate().string();
  return config.is_exposed(listen) ? "PLAIN on a reachable address" : "plain on loopback";
}

}  // namespace

int run(const CheckConfig& wish, std::ostream& out) {
  const Config config = load_config(wish.flags);
  fmt::print(out, "data     {}\n", std::filesystem::absolute(config.data_dir).string());
  fmt::print(out, "http     {}{}\n", config.http, config.http_or_any_port ? " (or a free port)" : "");
  fmt::print(out, "robots   {}{}\n", config.robots, config.robots_or_any_port ? " (or a free port)" : "");
  fmt::print(out, "tls      http {}, robots {}\n", protection(config, config.http), protection(config, config.robots));
  fmt::print(out, "limits   setpoint {} to {} m, duty {} to {}, disturbance {} m\n", config.limits.setpoint_min_m,
             config.limits.setpoint_max_m, config.limits.duty_min, config.limits.duty_max,
             config.limits.disturbance_max_m);
  print_recording(config.recording, out);
  fmt::print(out, "the configuration is valid\n");
  return 0;
}

}  // namespace server::cli
