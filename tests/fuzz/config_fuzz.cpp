// Feeds any text to the reader of the station's configuration: what it does not take, it refuses as
// std::invalid_argument with one sentence, and what it takes is within the limits that it names.
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "server/config/config.hpp"
#include "server/config/station_document.hpp"
#include "tests/fuzz/targets.hpp"

namespace server {
namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

void require_sane(const config::CommandLimits& limits) {
  require(limits.setpoint_min_m < limits.setpoint_max_m && limits.setpoint_step_m >= 0);
  require(std::abs(limits.duty_min) <= 1 && std::abs(limits.duty_max) <= 1 && std::abs(limits.power_duty) <= 1);
  require(limits.power_s >= 0 && std::isfinite(limits.disturbance_max_m));
}

void expect_within_limits(const config::Config& config) {
  for (const config::PortPlaces& places : {config.http_places, config.robot_places}) {
    require(places.connections >= 16 && places.connections <= 32'768);
    require(places.of_address >= 1 && places.of_address <= 32'768);
  }
  require(config.link.heartbeat_interval_ms * 2 <= config.link.link_timeout_ms);
  require(config.link.link_timeout_ms <= 5000);
  require_sane(config.envelope.anywhere());
  for (const auto& [fluid, limits] : config.envelope.of_fluid()) {
    require_sane(limits);
    require(config::fluid_name(fluid) == fluid);
  }
  require(config.recording.critical_space_mb <= config.recording.low_space_mb);
  for (const std::string& listen : {config.http, config.robots}) {
    require(!config.is_exposed(listen) || config.tls.insecure);  // SAFETY: nobody is exposed by accident
  }
  require(nlohmann::json::accept(station_document(config)));
}

void read(const std::string& text) {
  try {
    expect_within_limits(config::parse_config(text, "fuzz.toml"));
  } catch (const std::invalid_argument& error) {
    require(!std::string{error.what()}.empty());
  }
}

}  // namespace
}  // namespace server

int fuzz::config(const std::uint8_t* data, std::size_t size) {
  server::read({reinterpret_cast<const char*>(data), size});
  return 0;
}
