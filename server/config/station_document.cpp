// Limits and link times by their names in the configuration file.
#include "server/config/station_document.hpp"

#include <nlohmann/json.hpp>

#include "base/version.hpp"

namespace server::config {

nlohmann::json limits_json(const CommandLimits& limits) {
  return {{"setpoint_min_m", limits.setpoint_min_m},
          {"setpoint_max_m", limits.setpoint_max_m},
          {"setpoint_step_m", limits.setpoint_step_m},
          {"duty_min", limits.duty_min},
          {"duty_max", limits.duty_max},
          {"power_duty", limits.power_duty},
          {"power_s", limits.power_s},
          {"disturbance_max_m", limits.disturbance_max_m}};
}

std::string station_document(const Config& config) {
  nlohmann::json out;
  out["version"] = base::version();
  const Envelope& envelope = config.envelope;
  out["limits"] = limits_json(envelope.anywhere());
  for (const auto& [fluid, limits] : envelope.of_fluid()) out["limits_of_fluid"][fluid] = limits_json(limits);
  out["limits_where_fluid_unknown"] = limits_json(envelope.strictest());
  out["robots"] = {{"link_timeout_ms", config.link.link_timeout_ms},
                   {"heartbeat_interval_ms", config.link.heartbeat_interval_ms},
                   {"samples_per_frame", config.link.samples_per_frame}};
  return out.dump();
}

}  // namespace server::config
