// `rheonaut check-config`.
#include <fmt/format.h>
#include <fmt/ostream.h>

#include <algorithm>
#include <filesystem>

#include "server/cli/command_line.hpp"
#include "server/config/station_document.hpp"

namespace server::cli {
namespace {

std::string or_none(std::uint32_t value, const char* unit, const char* none) {
  return value == 0 ? none : fmt::format("{} {}", value, unit);
}

void print_recording(const config::RecordingConfig& recording, std::ostream& out) {
  fmt::print(out, "keep     {}, events {}, database {}, warning below {} MB free, nothing new below {} MB\n",
             or_none(recording.retention_days, "days", "for ever"),
             or_none(recording.event_retention_days, "days", "for ever"),
             or_none(recording.max_database_mb, "MB", "without limit"), recording.low_space_mb,
             recording.critical_space_mb);
  fmt::print(out, "give up  samples of robots that do not come back: {}\n",
             recording.give_up_after_days == 0 ? "only when an admin says so"
                                               : fmt::format("after {} days", recording.give_up_after_days));
}

// What keeps others from reading and changing what is sent.
std::string protection(const config::Config& config, const std::string& listen) {
  if (config.speaks_tls(listen)) return "TLS with " + config.tls_certificate().string();
  return config.is_exposed(listen) ? "PLAIN on a reachable address" : "plain on loopback";
}

nlohmann::ordered_json port_json(const config::Config& config, const std::string& listen, bool or_any_port,
                                 const config::PortPlaces& places) {
  const bool is_tls = config.speaks_tls(listen);
  return {{"listen", listen},
          {"or_any_port", or_any_port},
          {"max_connections", places.connections},
          {"max_connections_of_address", places.of_address},
          {"protection", is_tls                      ? "tls"
                         : config.is_exposed(listen) ? "plain_on_reachable_address"
                                                     : "plain_on_loopback"},
          {"tls_certificate", is_tls ? nlohmann::ordered_json(config.tls_certificate().string()) : nullptr}};
}

nlohmann::ordered_json json_of(const config::Config& config) {
  nlohmann::ordered_json of_fluid = nlohmann::ordered_json::object();
  for (const auto& [fluid, limits] : config.envelope.of_fluid()) of_fluid[fluid] = limits_json(limits);
  const config::RecordingConfig& recording = config.recording;
  return {{"valid", true},
          {"data", std::filesystem::absolute(config.data_dir).string()},
          {"http", port_json(config, config.http, config.http_or_any_port, config.http_places)},
          {"robots", port_json(config, config.robots, config.robots_or_any_port, config.robot_places)},
          {"limits", limits_json(config.envelope.anywhere())},
          {"limits_of_fluid", of_fluid},
          {"limits_where_fluid_unknown", limits_json(config.envelope.strictest())},
          {"recording",
           {{"retention_days", recording.retention_days},
            {"event_retention_days", recording.event_retention_days},
            {"give_up_after_days", recording.give_up_after_days},
            {"max_database_mb", recording.max_database_mb},
            {"low_space_mb", recording.low_space_mb},
            {"critical_space_mb", recording.critical_space_mb}}},
          {"log", {{"level", config.log_level}, {"format", config.log_format}}}};
}

}  // namespace

int run(const CheckConfig& line, std::ostream& out) {
  const config::Config config = load_config(line.flags);
  if (line.form.is_json) {
    write_json(out, json_of(config));
    return 0;
  }
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
